"""Scene files that cannot be used: what is changed in a sound one, and the name of each case."""

SOUND = """machine = "spherical"
form = "canonical"
frame = "regular"
[parameters]
m_3 = 15.0
[effects.gravity]
[effects.payload]
mass = 2.0
[effects.viscous]
c = [1.0, 1.0, 0.1, 5.0]
[limits]
q = { lower = [0.15, -3.0, -3.0, 0.6], upper = [2.8, 3.0, 3.0, 1.1] }
tau = [280.0, 170.0, 3.5, 420.0]
[task]
from = [0.9, 0.0, 0.0, 0.85]
to = [1.6, 2.0, 0.5, 0.9]
[[task.obstacles]]
shape = "ball"
centre = [0.0, 0.0, 3.0]
radius = 0.1
"""

# (name, old text, new text)
BROKEN = [
    ("unknown machine", '"spherical"', '"scara"'),
    ("machine missing", 'machine = "spherical"\n', ""),
    ("unknown table", "[limits]", "[limit]"),
    ("unknown form", '"canonical"', '"hamilton"'),
    ("unknown frame", '"regular"', '"arrow"'),
    ("frame of wrong type", '"regular"', "3"),
    ("unknown parameter", "m_3 = 15.0", "m3 = 15.0"),
    ("parameter of wrong type", "m_3 = 15.0", 'm_3 = "15 kg"'),
    ("parameter true", "m_3 = 15.0", "m_3 = true"),
    ("negative mass", "m_3 = 15.0", "m_3 = -15.0"),
    ("parameter nan", "m_3 = 15.0", "m_3 = nan"),
    ("unknown effect", "[effects.payload]", "[effects.load]"),
    ("unknown key of an effect", "mass = 2.0", "weight = 2.0"),
    ("missing key of an effect", "mass = 2.0\n", ""),
    ("value of an effect out of range", "mass = 2.0", "mass = -2.0"),
    ("infinite value of an effect", "mass = 2.0", "mass = inf"),
    ("wrong length in an effect", "c = [1.0, 1.0, 0.1, 5.0]", "c = [1.0, 1.0]"),
    ("degrees where nothing is an angle", "mass = 2.0", "mass_deg = 2.0"),
    ("text in an effect", "c = [1.0, 1.0, 0.1, 5.0]", 'c = [1.0, "a", 0.1, 5.0]'),
    ("wrong coordinate in an effect", "c = [1.0, 1.0, 0.1, 5.0]", "c = { theta = 1.0, chi = 1.0 }"),
    ("two effects that define the same", "[limits]",
     "[effects.coulomb]\nf = 1.0\n[effects.stribeck]\nf = 1.0\nf_static = 2.0\n[limits]"),
    ("an effect that reads a missing signal", "[limits]",
     "[effects.winding_heat]\nresistance = 1.0\ncapacity = 1.0\n[limits]"),
    ("unknown signal", "tau = [", "torque = ["),
    ("wrong length of a limit", "tau = [280.0, 170.0, 3.5, 420.0]", "tau = [280.0, 170.0, 3.5]"),
    ("negative limit", "tau = [280.0", "tau = [-280.0"),
    ("lower above upper", "lower = [0.15", "lower = [3.15"),
    ("infinite limit", "tau = [280.0", "tau = [inf"),
    ("limit of wrong type", "tau = [280.0, 170.0, 3.5, 420.0]", 'tau = "280 N m"'),
    ("degrees of a torque", "tau = [", "tau_deg = ["),
    ("both units", "from = [", "from_deg = [50.0, 0.0, 0.0, 0.85]\nfrom = ["),
    ("no task", "[task]", "[limits.v]\nupper = 2.0\n[other]"),
    ("no end", "to = [1.6, 2.0, 0.5, 0.9]\n", ""),
    ("start of wrong length", "from = [0.9, 0.0, 0.0, 0.85]", "from = [0.9, 0.0]"),
    ("start lacks a coordinate", "from = [0.9, 0.0, 0.0, 0.85]", "from = { theta_deg = 50, psi = 0, phi = 0 }"),
    ("via of wrong length", "to = [", "via = [[1.0, 1.0]]\nto = ["),
    ("unknown cost", "to = [", 'minimise = "energy"\nto = ['),
    ("unknown signal in the cost", "to = [", "minimise = { squares = { force = 1.0 } }\nto = ["),
    ("horizon not positive", "to = [", "horizon = -1.0\nto = ["),
    ("horizon of wrong type", "to = [", 'horizon = { guess = "1 s" }\nto = ['),
    ("one fixed horizon for two legs", "to = [", "via = [[1.0, 1.0, 0.2, 0.85]]\nhorizon = 2.0\nto = ["),
    ("no whole number of elements", "to = [", "elements = 2.5\nto = ["),
    ("unknown shape", '"ball"', '"sphere"'),
    ("key of another shape", "radius = 0.1", "radius = 0.1\naxis = [0.0, 0.0, 1.0]"),
    ("negative radius", "radius = 0.1", "radius = -0.1"),
    ("centre of wrong length", "centre = [0.0, 0.0, 3.0]", "centre = [0.0, 3.0]"),
    ("no TOML", "m_3 = 15.0", "m_3 = 15.0 kg"),
    ("a key twice", "m_3 = 15.0", "m_3 = 15.0\nm_3 = 16.0"),
    ("nothing", SOUND, ""),
]  # fmt: skip
