"""Small URDF files for tests."""

INERTIAL = '<inertial><mass value="2"/><inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial>'
LIMIT = '<limit lower="-1" upper="2" velocity="3" effort="10"/>'


def joint(name, parent, child, more="", kind="revolute", inside=LIMIT):
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{inside}{more}</joint>'


def robot(*parts, links=("base", "a", "b"), name="r"):
    made = "".join(
        f'<link name="{link}">{INERTIAL}</link>' if link != "base" else '<link name="base"/>' for link in links
    )
    return f'<?xml version="1.0"?><robot name="{name}">{made}{"".join(parts)}</robot>'


AXIS_Y = '<axis xyz="0 1 0"/>'
GOOD = robot(joint("q1", "base", "a"), joint("q2", "a", "b", AXIS_Y + '<origin xyz="0 0 0.5"/>'))
