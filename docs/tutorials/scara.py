"""A SCARA arm and an effect of its own; used by the tutorial, and by scene files with --with scara.py."""

from dataclasses import dataclass

from models import Joint, Kind, Link, Manipulator, serial
from models.effects import Terms


def scara(*, L_1: float = 0.4, L_2: float = 0.3, m_1: float = 8.0, m_2: float = 5.0, m_3: float = 1.5) -> Manipulator:
    """Return a SCARA arm: two vertical axes, then a spindle that moves up and down.

    Args:
        L_1, L_2: lengths of the two links, mass centres half way [m].
        m_1, m_2, m_3: masses of the links and of the spindle [kg].
    """
    bar = (0.01, 0.05, 0.05)  # moments of a slender link about its mass centre [kg m^2]
    return serial(
        [
            Joint("shoulder", origin=(0.0, 0.0, 0.4), link=Link(m_1, (L_1 / 2, 0.0, 0.0), bar)),
            Joint("elbow", origin=(L_1, 0.0, 0.0), link=Link(m_2, (L_2 / 2, 0.0, 0.0), bar)),
            Joint(
                "spindle",
                Kind.PRISMATIC,
                origin=(L_2, 0.0, 0.0),
                axis=(0.0, 0.0, -1.0),
                link=Link(m_3, (0.0, 0.0, 0.0), bar),
            ),
        ],
        tool=(0.0, 0.0, -0.1),
        name="scara",
    )


@dataclass(frozen=True)
class HoseSpring:
    """A hose that pulls every joint back to its zero position like a spring."""

    stiffness: float = 5.0  # [N m/rad or N/m]

    def __call__(self, machine: Manipulator, so_far: Terms) -> Terms:
        """Return the force -k q in every joint."""
        return Terms(force=-self.stiffness * machine.q)
