"""Structures: merged arcs and tables, revision of hand-made arcs, reading of hand-made motions."""

from dataclasses import replace
from types import SimpleNamespace

import casadi as ca
import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest
from catalogue import problems
from matplotlib.colors import to_rgb

from models import plots
from models.plots import structures
from ocp import Bolza, Free, Problem, System, along, end, polish, solve, start, uniform
from ocp.arcs.detection import read
from ocp.arcs.limit_arcs import contacts
from ocp.arcs.optimality_check import Certificate, Crossing, WrongSign
from ocp.arcs.revision import (
    revise,
    swapped,
    with_contact,
    with_sign,
    without_false_contacts,
    without_shortest_hold,
    without_vanished,
)
from ocp.arcs.state_limit_multipliers import Jump
from ocp.problem.state_constraints import state_limits
from ocp.solution.structure import Arc, Contact, Kind, Row, Structure
from ocp.solution.structure_table import merged, tabulate

matplotlib.use("Agg")
LOWER, UPPER, INTERIOR, HOLDING = Kind.LOWER, Kind.UPPER, Kind.INTERIOR, Kind.HOLDING
HELD, TOUCHED = Contact(0, 1, 0), Contact(0, 1)
RIGHT = Certificate(0.0, (), (), (), (), np.zeros(0))
AXIS = problems.lift_fastest(speed=1.2).problem  # its only state limit is |x_2| <= 1.2, of order 1
POSITION = replace(AXIS, subject_to=(*AXIS.subject_to[:2], along(AXIS.system.x[0], upper=0.9), AXIS.subject_to[-1]))


def arcs_of(*parts):
    """Return arcs of one control from pairs of kind and duration."""
    return tuple(Arc((kind,), duration) for kind, duration in parts)


def revised(arcs, problem=POSITION, **wrong):
    return revise(SimpleNamespace(arcs=arcs), replace(RIGHT, **wrong), state_limits(problem))


def ends(arcs):
    return np.cumsum([arc.duration for arc in arcs])


def test_arcs_that_only_continue_are_merged():
    arcs = arcs_of((UPPER, 1.0), (UPPER, 2.0), (LOWER, 0.5))
    assert merged(arcs) == arcs_of((UPPER, 3.0), (LOWER, 0.5))
    touching = arcs[0], replace(arcs[1], touched=(TOUCHED,))
    assert merged(touching) == touching
    held = arcs[0], replace(arcs[1], held=(HELD,))
    assert merged(held) == held


def test_table_of_two_controls_and_their_limits():
    known = problems.double_integrator_2d().problem
    problem = replace(known, subject_to=(*known.subject_to, along(known.system.x[2:], -7.0, 7.0)))
    held = Contact(0, -1, 0)
    arcs = (
        Arc((LOWER, UPPER), 1.0),
        Arc((HOLDING, UPPER), 2.0, (held,)),
        Arc((HOLDING, LOWER), 1.0, (held,)),
        Arc((UPPER, LOWER), 3.0, (), (Contact(1, 1),)),
    )
    structure = tabulate(problem, state_limits(problem), arcs)
    assert list(structure) == [
        Row("u_1", LOWER, 0.0, 1.0), Row("u_1", HOLDING, 1.0, 4.0), Row("u_1", UPPER, 4.0, 7.0),
        Row("u_2", UPPER, 0.0, 3.0), Row("u_2", LOWER, 3.0, 7.0),
        Row("x_3", Kind.LIMIT, 1.0, 4.0), Row("x_4", Kind.TOUCH, 4.0, 4.0),
    ]  # fmt: skip
    assert len(structure) == 7
    assert structure[-1].kind is Kind.TOUCH
    assert structure.arcs == arcs
    assert structure.switches("u_1") == (1.0, 4.0)
    assert structure.switches("u_2") == (3.0,)
    with pytest.raises(ValueError, match="no row 'u_3'; there are u_1, u_2, x_3, x_4"):
        structure.switches("u_3")


def test_table_is_printed_with_a_name_for_each_group():
    arcs = arcs_of((UPPER, 0.25), (LOWER, 0.5))
    assert str(tabulate(AXIS, state_limits(AXIS), arcs)).splitlines() == [
        "   kind      from [s]        to [s]",
        "u  upper     0               0.25",
        "   lower     0.25            0.75",
    ]
    assert isinstance(tabulate(AXIS, (), arcs), Structure)


def test_vanished_arc_is_dropped_and_its_neighbours_merged():
    assert without_vanished(arcs_of((UPPER, 1.0), (LOWER, 0.0), (UPPER, 2.0))) == arcs_of((UPPER, 3.0))
    assert without_vanished(arcs_of((UPPER, 1.0), (LOWER, 2.0))) == arcs_of((UPPER, 1.0), (LOWER, 2.0))
    assert without_vanished(arcs_of((UPPER, 0.0))) == arcs_of((UPPER, 0.0))


def test_limit_held_for_no_time_is_touched():
    arcs = Arc((UPPER,), 1.0), Arc((HOLDING,), 1e-9, (HELD,)), Arc((LOWER,), 1.0)
    assert without_vanished(arcs) == (arcs[0], Arc((LOWER,), 1.0, (), (TOUCHED,)))


def test_end_of_a_hold_that_vanishes_leaves_no_touch():
    arcs = Arc((HOLDING,), 1.0, (HELD,)), Arc((HOLDING,), 0.0, (HELD,)), Arc((LOWER,), 1.0)
    assert without_vanished(arcs) == (arcs[0], arcs[2])


def test_touch_with_a_wrong_jump_is_released():
    arcs = Arc((UPPER,), 1.0), Arc((UPPER,), 1.0, (), (TOUCHED,)), Arc((LOWER,), 1.0)
    found = revised(arcs, jumps=(Jump(1, TOUCHED, -1.0),))
    assert found == arcs_of((UPPER, 2.0), (LOWER, 1.0))
    wrong = replace(RIGHT, jumps=(Jump(2, TOUCHED, -1.0),))
    assert without_false_contacts(arcs, wrong, state_limits(POSITION)) == arcs


def test_hold_with_a_wrong_multiplier_becomes_a_touch():
    arcs = Arc((UPPER,), 1.0), Arc((HOLDING,), 1.0, (HELD,)), Arc((LOWER,), 1.0)
    found = revised(arcs, released=((1, HELD),))
    assert found == (arcs[0], Arc((INTERIOR,), 1.0, (), (TOUCHED,)), arcs[2])


def test_shortest_hold_goes_first():
    arcs = (
        Arc((UPPER,), 1.0), Arc((HOLDING,), 0.5, (HELD,)), Arc((LOWER,), 1.0),
        Arc((HOLDING,), 0.4, (replace(HELD, side=-1),)), Arc((UPPER,), 1.0),
    )  # fmt: skip
    once = without_shortest_hold(arcs)
    assert once == (*arcs[:2], Arc((LOWER,), 1.4), arcs[4])
    assert without_shortest_hold(once) == arcs_of((UPPER, 1.5), (LOWER, 1.4), (UPPER, 1.0))
    assert without_shortest_hold(arcs_of((UPPER, 1.0))) == arcs_of((UPPER, 1.0))


def test_contact_is_added_where_a_limit_is_exceeded_most():
    arcs = arcs_of((UPPER, 1.0), (LOWER, 1.0))
    found = revised(arcs, crossings=(Crossing(TOUCHED, 1.2, 1.6, 1.5, 1e-3),))
    np.testing.assert_allclose(ends(found), [1.0, 1.5, 2.0], rtol=1e-15)
    assert [arc.touched for arc in found] == [(), (), (TOUCHED,)]
    assert [arc.kinds for arc in found] == [(UPPER,), (LOWER,), (LOWER,)]


def test_control_at_the_wrong_limit_is_changed_within_the_interval():
    arcs = arcs_of((UPPER, 2.0), (LOWER, 1.0))
    found = with_sign(arcs, WrongSign(0, 0.5, 1.5, 1e-3, LOWER))
    assert [arc.kinds[0] for arc in found] == [UPPER, LOWER, UPPER, LOWER]
    np.testing.assert_allclose(ends(found), [0.75, 1.25, 2.0, 3.0], rtol=1e-12)
    assert revised(arcs, signs=(WrongSign(0, 0.5, 1.5, 1e-3, LOWER),)) == found


def test_control_wrong_along_its_whole_spell_changes_there():
    arcs = Arc((UPPER, UPPER), 1.0), Arc((LOWER, UPPER), 1.0), Arc((UPPER, UPPER), 1.0)
    found = with_sign(arcs, WrongSign(0, 1.01, 1.99, 1e-3, UPPER))
    assert found == (Arc((UPPER, UPPER), 3.0),)


def test_switches_between_which_an_arc_has_vanished_change_places():
    # The first control lets go of the limit before the second one switches; it turns out to be the other way round.
    arcs = Arc((HOLDING, UPPER), 1.0, (HELD,)), Arc((LOWER, UPPER), 0.0), Arc((LOWER, LOWER), 1.0)
    assert swapped(arcs) == (arcs[0], Arc((HOLDING, LOWER), 0.0, (HELD,)), arcs[2])
    assert swapped(swapped(arcs)) == arcs
    entry = Arc((UPPER, UPPER), 1.0), Arc((HOLDING, UPPER), 0.0, (HELD,)), Arc((HOLDING, LOWER), 1.0, (HELD,))
    assert swapped(entry) == (entry[0], Arc((UPPER, LOWER), 0.0), entry[2])


def test_switches_of_one_control_and_arcs_of_some_length_do_not_change_places():
    one = arcs_of((UPPER, 1.0), (LOWER, 0.0), (UPPER, 1.0))
    assert swapped(one) == one
    long = Arc((UPPER, UPPER), 1.0), Arc((LOWER, UPPER), 0.1), Arc((LOWER, LOWER), 1.0)
    assert swapped(long) == long


def test_nothing_wrong_changes_nothing():
    arcs = arcs_of((UPPER, 1.0), (LOWER, 1.0))
    assert revised(arcs) == arcs


def motion(problem, accelerations, switching, elements=20):
    """Return a solution of z'' = a from rest with given accelerations of equal elements, for 1 s.

    Its costate of the speed is the switching function of the acceleration at the middles of elements.
    """
    solution = solve(replace(problem, horizon=Free(1.0), subject_to=problem.subject_to[-1:]), grid=uniform(elements))
    width = 1.0 / elements
    x = np.zeros((elements, len(solution.scheme.nodes), 2))
    at, speed = 0.0, 0.0
    for k, a in enumerate(accelerations):
        t = solution.scheme.nodes * width
        x[k] = np.array([at + speed * t + a * t**2 / 2, speed + a * t]).T
        at, speed = x[k, -1]
    times = (solution.grid.ends[:-1, None] + width * solution.scheme.points).ravel()
    slope = np.array([switching(t) for t in times]).reshape(elements, -1)
    costates = np.stack([np.zeros_like(slope), slope], axis=2)
    controls = 3.0 * (np.array(accelerations)[:, None, None] + problems.G)
    return replace(solution, problem=problem, duration=1.0, states=x, controls=controls, costates=costates)


FAST, SLOW = 20.0 - problems.G, -20.0 - problems.G
FREE = Problem(AXIS.system, AXIS.horizon, AXIS.minimise, (start(AXIS.system.x, 0), AXIS.subject_to[-1]))


def test_switch_inside_an_element_is_where_the_mean_control_puts_it():
    mixed = 0.3 * FAST + 0.7 * SLOW
    solution = motion(FREE, [FAST] * 8 + [mixed] + [SLOW] * 11, lambda t: t - 0.415)
    found = read(FREE, solution, ())
    assert [arc.kinds for arc in found] == [(UPPER,), (LOWER,)]
    assert found[0].duration == pytest.approx(8.3 / 20, rel=1e-12)


def test_short_excursion_keeps_its_share():
    mixed = 0.8 * FAST + 0.2 * SLOW
    solution = motion(FREE, [FAST] * 5 + [mixed] + [FAST] * 14, lambda t: abs(t - 0.275) - 0.005)
    found = read(FREE, solution, ())
    assert [arc.kinds for arc in found] == [(UPPER,), (LOWER,), (UPPER,)]
    assert found[1].duration == pytest.approx(0.2 / 20, rel=1e-9)


def test_control_that_nothing_determines_is_interior():
    solution = motion(FREE, [FAST] * 6 + [0.0, -1.0, 1.0, 0.5, -0.5, 0.0] + [SLOW] * 8, lambda t: 0.0)
    assert [arc.kinds for arc in read(FREE, solution, ())] == [(UPPER,), (INTERIOR,), (LOWER,)]


def test_chatter_is_where_the_switching_function_wants_it():
    solution = motion(FREE, [FAST] * 6 + [0.0, -1.0, 1.0, 0.5, -0.5, 0.0] + [SLOW] * 8, lambda t: t - 0.45)
    found = read(FREE, solution, ())
    assert [arc.kinds for arc in found] == [(UPPER,), (LOWER,)]
    assert found[0].duration == pytest.approx(0.45, abs=0.05)


def test_held_limit_and_the_control_that_holds_it():
    top = 1.2
    rise = [top / 0.25] * 5
    solution = motion(AXIS, [*rise, *[0.0] * 10, *[-top / 0.25] * 5], lambda t: 0.0)
    limits = state_limits(AXIS)
    (hold,), touches = contacts(AXIS, solution, limits)
    assert (hold.contact, touches) == (Contact(0, 1, 0), [])
    assert (hold.start, hold.end) == pytest.approx((0.25, 0.75), abs=0.01)
    held = [arc for arc in read(AXIS, solution, limits) if arc.held]
    assert [arc.kinds for arc in held] == [(HOLDING,)]


def test_limit_met_at_one_instant_is_touched():
    a = 10.0
    top = a * 0.25**2
    problem = replace(FREE, subject_to=(*FREE.subject_to, along(AXIS.system.x[0], upper=top)))
    solution = motion(problem, [a] * 5 + [-a] * 10 + [a] * 5, lambda t: 0.0)
    limits = state_limits(problem)
    holds, ((t, contact),) = contacts(problem, solution, limits)
    assert (holds, contact) == ([], Contact(0, 1))
    assert t == pytest.approx(0.5, abs=1e-9)
    (touching,) = [k for k, arc in enumerate(read(problem, solution, limits)) if arc.touched]
    assert ends(read(problem, solution, limits))[touching - 1] == pytest.approx(0.5, abs=1e-9)


def test_contact_of_a_limit_without_order_is_not_added():
    problem = replace(FREE, subject_to=(*FREE.subject_to, along(AXIS.system.x[0] * AXIS.system.u, upper=1.0)))
    limits = state_limits(problem)
    assert [limit.order for limit in limits] == [0]
    arcs = arcs_of((UPPER, 1.0), (LOWER, 1.0))
    assert with_contact(arcs, Crossing(TOUCHED, 1.2, 1.6, 1.5, 1e-3), limits) == arcs


@pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
def test_picture_of_a_structure_is_written(tmp_path, suffix):
    coarse = solve(AXIS, grid=uniform(20))
    path = tmp_path / f"structure.{suffix}"
    with pytest.raises(ValueError, match="no structure; polish it first"):
        plots.structure(coarse, path)
    polished = polish(coarse)
    with pytest.raises(ValueError, match="loaded without its model"):
        plots.structure(replace(polished, problem=None), path)
    assert not path.exists()
    plots.structure(polished, path)
    assert path.read_bytes().startswith({"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}[suffix])
    assert [one.name for one in tmp_path.iterdir()] == [path.name]
    assert plt.get_fignums() == []


def test_picture_of_a_structure_shows_the_arcs_where_they_are():
    """Bars of the panels of the control are the arcs of the table; curve, limits and switching function fit them."""
    polished = polish(solve(AXIS, grid=uniform(20)))
    figure = plots.structure(polished)
    try:
        control, switching, held, hamiltonian = figure.axes
        arcs = [row for row in polished.structure.rows if row.name == control.get_ylabel().partition("\n")[0]]
        assert [row.kind for row in arcs] == [UPPER, HOLDING, LOWER]
        spans = [(bar.get_x(), bar.get_x() + bar.get_width()) for bar in control.patches]
        np.testing.assert_allclose(spans, [(row.start, row.end) for row in arcs], rtol=1e-12)
        colours = [bar.get_facecolor()[:3] for bar in control.patches]
        np.testing.assert_allclose(colours, [to_rgb(structures.COLOURS[row.kind]) for row in arcs])
        curve, *limits = (np.array(line.get_data()) for line in control.lines)
        assert {float(line[1][0]) for line in limits} == {-60.0, 60.0}  # N, of the catalogue
        inside = polished.u(curve[0])[:, 0]
        away = np.min(np.abs(curve[0][:, None] - [row.end for row in arcs]), axis=1) > 1e-9
        np.testing.assert_allclose(curve[1][away], inside[away], atol=1e-12)
        t, value = switching.lines[-1].get_data()
        for row in arcs[::2]:  # dH/du < 0 where the upper limit is optimal, > 0 where the lower one is
            middle = (t > row.start + 1e-6) & (t < row.end - 1e-6)
            assert np.all(np.sign(value[middle]) == {UPPER: -1.0, LOWER: 1.0}[row.kind])
        (bar,) = held.patches
        assert (bar.get_x(), bar.get_x() + bar.get_width()) == pytest.approx((arcs[1].start, arcs[1].end))
        assert np.max(held.lines[0].get_data()[1]) == pytest.approx(1.2)
        assert np.ptp(hamiltonian.lines[0].get_data()[1]) < 1e-7
    finally:
        plt.close(figure)


def test_picture_of_touches_and_of_controls_without_limits(tmp_path):
    polished = polish(solve(problems.bryson_denham(0.2).problem, grid=uniform(20)))
    touches = [row.start for row in polished.structure.rows if row.kind is Kind.TOUCH]
    assert touches
    figure = plots.structure(polished)
    drawn = [line.get_xdata()[0] for axes in figure.axes for line in axes.lines if np.ptp(line.get_xdata()) == 0.0]
    plt.close(figure)
    np.testing.assert_allclose(sorted(drawn), sorted(touches))


def test_control_without_limits_is_never_at_one():
    free = replace(FREE, subject_to=FREE.subject_to[:1])
    solution = motion(FREE, [FAST] * 6 + [0.0, -1.0, 1.0, 0.5, -0.5, 0.0] + [SLOW] * 8, lambda t: t - 0.45)
    assert [arc.kinds for arc in read(free, replace(solution, problem=free), ())] == [(INTERIOR,)]


def test_nothing_depends_on_the_order_in_which_parameter_values_are_given(tmp_path):
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("p", 3)
    strength, weight, top = p[0], p[1], p[2]
    axis = System(x, u, p, ca.vertcat(x[1], strength * u - weight), {}, {"strength": 7.0, "weight": 3.0, "top": 0.8})
    problem = Problem(axis, Free(1.0), Bolza(time=1.0), (
        start(x, 0.0), end(x, [1.0, 0.0]), along(u, -1.0, 1.0), along(x[1] / top, upper=1.0),
    ))  # fmt: skip
    coarse = solve(problem, grid=uniform(20))
    turned = replace(coarse, values=dict(reversed(coarse.values.items())))
    assert list(turned.values) != list(coarse.values)
    limits = state_limits(problem)
    assert len(contacts(problem, coarse, limits)[0]) == 1
    assert contacts(problem, turned, limits) == contacts(problem, coarse, limits)
    assert read(problem, turned, limits) == read(problem, coarse, limits)
    one, other = polish(coarse), polish(turned)
    # From rest to 0.8 with 4, on, and back to rest with -10, over 1 in all.
    assert one.duration == pytest.approx(0.2 + 0.08 + (1.0 - 0.08 - 0.032) / 0.8, rel=1e-9)
    assert (other.duration, other.structure) == (one.duration, one.structure)
    pictures = []
    for name, solution in (("one", one), ("other", replace(one, values=dict(reversed(one.values.items()))))):
        plots.structure(solution, tmp_path / f"{name}.png")
        pictures.append((tmp_path / f"{name}.png").read_bytes())
    assert pictures[0] == pictures[1]
