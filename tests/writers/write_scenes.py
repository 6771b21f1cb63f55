"""Write docs/scenes.md from the example scenes and the broken ones: python tests/writers/write_scenes.py."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.extend(str(Path(__file__).resolve().parents[2] / folder) for folder in ("tests", "scripts"))

from catalogue.broken_scenes import BROKEN, BROKEN_ARM, SOUND, SOUND_ARM
from reports import effect_budget as budget

from models.scenes import task_file
from models.scenes.toml_document import SceneError
from ocp import uniform

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "scenes.md"
SCENES = ROOT / "scripts" / "scenes"
EXAMPLES = ("spherical", "cylindrical", "torus")

HEAD = """# Scenes

A scene is a machine with the effects that its task calls for, and the form and frame of its equations. An effect that
is not listed leaves no trace. In Python it is one value; in a file it is TOML, beside the task:

```sh
hamel template torus > arm.toml       # every key, with units; also ur5, panda, a URDF file; all effects, in comments
hamel card arm.toml                   # what it is, before it is solved
hamel time-optimal arm.toml --report  # solve, verify, table, picture, report
hamel budget arm.toml --report        # what each effect costs
```

```python
from models import Scene, spherical
from models.effects import Gravity, Payload

scene = Scene(spherical(), (Gravity(), Payload(2.0)))   # form=canonical, frame="regular"
print(scene)                                            # the card
print([(effect.name, effect.instructions) for effect in scene.prices])
arm = scene.system                                      # x' = f(x, u, p) with its signals, for any Problem
```

## The file

SI units and radians. A key that ends in `_deg` takes degrees: `from_deg = [...]`, `lower_deg = [...]`,
`{ theta_deg = 50.0, r = 0.8 }`; in a list, lengths stay in metres. One number for each coordinate is a list in the
order of the coordinates, a table by their names, or a single number for all. Numbers are finite; where a limit or an
effect does not concern a coordinate, leave it out of the table. Unknown keys are errors. Reading a file
executes nothing.

| key | what | default |
|---|---|---|
| `machine` | `cylindrical`, `spherical`, `torus`, or of `--with`; `{ robot = "ur5" }`; `{ urdf = "a.urdf" }` | none |
| `form`, `frame` | of the equations; `inverse` has no frame | `canonical`, `regular` |
| `[parameters]` | of the machine, by name | those of the machine |
| `[effects.NAME]` | one table for each effect that is on, its fields as keys | no effect |
| `[limits]` | any signal along the motion: a number for both directions, or `{ lower = ..., upper = ... }` | effects |
| `[task]` `from`, `to` | a position, at rest; or signals by name, `{ tool = [...] }`, `{ q = ..., v = ... }` | none |
| `orientation` | of the tool of an arm, in such a point: `[roll, pitch, yaw]`, about the axes of the base | any |
| `[task]` `via` | list of such points, passed in this order at any speed; a leg ends at each | none |
| `[task]` `minimise` | `"time"`, or `{ time = ..., squares = { SIGNAL = ... }, integral = { ... } }` | `"time"` |
| `[task]` `horizon` | free: `{ guess, lower, upper }`, fixed: a number; with `via` a list, one for each leg | free |
| `[task]` `elements` | of the grid of each leg | 50 |
| `[[task.obstacles]]` | `shape` (`ball`, `box`, `cylinder`, `half_space`) with its numbers | none |
| `keep`, `signal`, `name` | `"outside"` or `"inside"`; what keeps out of it; in reports | `"outside"`, `"tool"` |
| `[collisions]` `clearance` | distance of all links from the floor and from obstacles without a `signal` [m] | 0 |
| `floor`, `links` | height of the floor [m]; `false`: obstacles are for the tool only | no floor, `true` |
| `self`, `self_clearance` | `true`, or pairs of links `[["a", "b"]]` that do not touch; distance [m] | `false`, 0 |
| `radius` | of capsules along the lines of the arm [m] | those of the arm |
| `[[collisions.capsules]]` | further capsules: `body`, `start`, `end`, `radius` [m] | none |
| `margin`, `cover` | distance kept beyond the clearance at the nodes; of spheres beyond the links [m] | 0.001, 0.02 |

A limit on a signal that an effect limits already takes the place of the effect's. With a horizon for the whole motion
and via points, only `guess` is given, and shared among the legs. The signals of a scene stand on its card.

## Links, obstacles, goals of the tool

With a table `[collisions]` all links keep clear, not the tool alone. UR5, UR10, Panda, the arm of three axes, and URDF
files with boxes, cylinders and spheres have capsules; others get them along their lines with `radius`, or one by one
with `[[collisions.capsules]]` (points from the mass centre of the body, in its axes). A start or a goal that touches
something, or is nearer than the clearance, is refused at once, with both bodies and the distance. The account, the
report and `--json` state the least distances of the motion found, measured between the nodes, with their times. The
first body stands on the floor and is left out, with points that no joint moves; `inside` is for the tool only.

```toml
machine = { robot = "ur5" }
form = "inverse"        # accelerations as controls: 53 iterations, verified; canonical: 211
[effects.gravity]
[limits]
machine = true
[collisions]
clearance = 0.02        # m
floor = 0.0             # m
self = true
[task]
from = [0.0, -1.2, 1.4, -1.6, -1.5, 0.0]
to = { tool = [-0.13, 0.69, 0.27], orientation_deg = [180.0, 0.0, 90.0] }
elements = 30
[[task.obstacles]]
name = "post"
shape = "cylinder"
centre = [0.40, 0.46, 0.15]
axis = [0.0, 0.0, 1.0]
radius = 0.05
length = 0.3
```

A goal of the tool has several positions of the joints; the first guess leads to the nearest one within the limits
(`multistart`, or `--starts 6`, tries others). In Python it is `end(arm["tool"], point)` and
`end(orientation_error(arm, rotation), 0)`, and `keep_clear(...)` for collisions, see [chains](chains.md).

"""


def example(name: str) -> str:
    """Return what --card prints for an example."""
    scene, task = task_file.load(SCENES / f"{name}.toml")
    return f"{scene.card()}\n{task.card(scene.system)}"


def messages() -> list[tuple[str, str]]:
    """Return the message about every broken file."""
    results = []
    for sound, broken in ((SOUND, BROKEN), (SOUND_ARM, BROKEN_ARM)):
        for name, old, new in broken:
            try:
                task_file.of_text(sound.replace(old, new, 1), "arm.toml")
            except SceneError as error:
                results.append((name, str(error)))
    return results


def main() -> None:
    """Solve, and write the page."""
    parts = [HEAD, "## An example\n\n`scripts/scenes/spherical.toml`; the others are `cylindrical.toml` (an obstacle)"
             " and `torus.toml` (a via point).\n\n```toml\n", (SCENES / "spherical.toml").read_text(encoding="utf-8"),
             "```\n\n## Cards\n\n`--card` prints, for the three examples,\n\n"]  # fmt: skip
    parts += [f"```\n{example(name)}\n```\n\n" for name in EXAMPLES]
    parts.append("The instruction count of an effect is that of x' = f(x, u, p) with it minus that without.\n\n")
    parts.append("## The effect budget\n\n`--budget` prints\n\n")
    for name in EXAMPLES:
        scene, task = task_file.load(SCENES / f"{name}.toml")
        parts.append(f"```\n{budget.effect_budget(scene, task, uniform(task.elements))}\n```\n\n")
    parts.append(
        "Each row is a solve, not a sensitivity: leaving an effect out is a finite change that may move the motion to\n"
        "another local optimum or change its states, and peak torques and seconds have no derivative. A row is solved\n"
        "from the default guess and, where the states are the same, from the motion of the whole scene; the better\n"
        "one counts, and a note shows when they are two optima. Rows that are not verified show no figures.\n\n"
    )
    parts.append("## Messages about files that cannot be used\n\nOne sentence, exit status 2:\n\n")
    parts += [f"- {name}: `{message}`\n" for name, message in messages()]
    PAGE.write_text("".join(parts), encoding="utf-8")


if __name__ == "__main__":
    main()
