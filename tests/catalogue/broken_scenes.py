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

SOUND_ARM = """machine = { robot = "ur5" }
[limits]
machine = true
[collisions]
clearance = 0.02
floor = 0.0
self = [["shoulder_lift_joint", "wrist_1_joint"]]
[task]
from = [0.0, -1.2, 1.4, -1.6, -1.5, 0.0]
to = { q = [1.6, -1.0, 1.2, -1.6, -1.5, 0.5] }
[[task.obstacles]]
name = "post"
shape = "cylinder"
centre = [0.40, 0.46, 0.15]
axis = [0.0, 0.0, 1.0]
radius = 0.05
length = 0.3
"""

BROKEN_ARM = [
    ("unknown key of collisions", "clearance = 0.02", "distance = 0.02"),
    ("negative clearance", "clearance = 0.02", "clearance = -0.02"),
    ("clearance of wrong type", "clearance = 0.02", 'clearance = "2 cm"'),
    ("collisions of wrong type", "[collisions]\nclearance = 0.02\nfloor = 0.0\n", "[[collisions]]\n"),
    ("start in an obstacle", "centre = [0.40, 0.46, 0.15]", "centre = [0.55, 0.11, 0.3]"),
    ("goal in an obstacle", "centre = [0.40, 0.46, 0.15]", "centre = [-0.13, 0.60, 0.3]"),
    ("start nearer than the clearance", "clearance = 0.02", "clearance = 0.04"),
    ("start nearer than the spheres allow", "radius = 0.05\nlength = 0.3", "radius = 0.31\nlength = 1.0"),
    ("via point in an obstacle", "to = {", "via = [[1.0, -0.5, 1.8, -1.6, -1.5, 0.0]]\nto = {"),
    ("floor above the base", "floor = 0.0", "floor = 0.2"),
    ("floor of wrong type", "floor = 0.0", "floor = true"),
    ("link folded onto another", "to = { q = [1.6, -1.0, 1.2", "to = { q = [1.6, -1.6, 3.0"),
    ("unknown link of a pair", '"wrist_1_joint"', '"wrist1"'),
    ("a pair of one link", '"wrist_1_joint"', '"shoulder_lift_joint"'),
    ("three links of a pair", '["shoulder_lift_joint", "wrist_1_joint"]', '["shoulder_lift_joint"]'),
    ("self of wrong type", 'self = [["shoulder_lift_joint", "wrist_1_joint"]]', "self = 1"),
    ("radius beside capsules", "clearance = 0.02", "radius = 0.05"),
    ("no capsules", '"ur5"', '"puma560"'),
    ("capsule of no body", "[task]", '[[collisions.capsules]]\nbody = "hand"\nstart = [0, 0, 0]\nend = [0, 0, 0.1]\n'
     "radius = 0.03\n[task]"),
    ("capsule without an end", "[task]", '[[collisions.capsules]]\nbody = "elbow_joint"\nstart = [0, 0, 0]\n[task]'),
    ("margin of zero", "clearance = 0.02", "margin = 0.0"),
    ("cover too thin", "clearance = 0.02", "cover = 1e-6"),
    ("links of wrong type", "clearance = 0.02", "links = 1"),
    ("two obstacles of one name", "[[task.obstacles]]",
     '[[task.obstacles]]\nname = "post"\nshape = "ball"\ncentre = [0, 0, 3]\nradius = 0.1\n[[task.obstacles]]'),
    ("an obstacle named floor", '"post"', '"floor"'),
    ("orientation of two angles", "to = { q = [1.6, -1.0, 1.2, -1.6, -1.5, 0.5] }",
     "to = { tool = [0.1, 0.6, 0.3], orientation = [0, 0] }"),
    ("orientation twice", "to = { q = [1.6, -1.0, 1.2, -1.6, -1.5, 0.5] }",
     "to = { orientation = [0, 0, 0], orientation_deg = [0, 0, 0] }"),
]  # fmt: skip
