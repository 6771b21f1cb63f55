"""Classes of release 0.1.0, and functions inside of machines; identities of stored studies contain these names.

module: Class(fields of a dataclass) function(enclosed variables) present name=former name ...

A class that was not in that release counts by its name alone, wherever it lies. A field that was added since counts
only where it differs from its default. See ocp.studies.origins.
models.toroid: torus_frames.<locals>.paper=_metric_and_frames.<locals>.paper(above minus p plus root sigma)
    torus_frames.<locals>.root=_metric_and_frames.<locals>.root(g11 q t2 t3)
"""

RELEASED = """
models.bands: Factors(size half pivots multipliers log_determinant)
models.composition: Composed(path law)
models.document: SceneError Table(file lines key entries)
models.effects.capability: PowerLimit(limit brake) TorqueSpeed(stall no_load peak)
models.effects.counterbalance: Counterbalance(mass stiffness at anchor free_length body)
models.effects.drive: ElasticDrive(stiffness inertia damping) LaggedDrive(time_constant)
models.effects.fields: Fields(prefix entries symbols nominal)
models.effects.friction: Coulomb(f width) Stribeck(f f_static speed width) Viscous(c)
models.effects.gravity: Gravity(g direction)
models.effects.motor: MotorDrive(constant resistance inductance ratio) WindingHeat(resistance capacity limit ambient
    initial)
models.effects.payload: Payload(mass offset inertia)
models.effects.rotor: RotorInertia(inertia ratio coupling)
models.effects.stop: JointStop(lower upper stiffness damping width)
models.effects.tool: ToolForce(force moment of in_tool_axes)
models.estimation: Course(t q v a tau values) Estimate(name on effect peak rms share use note) Solved
models.expressions: ExpressionCurve(derivatives) FunctionCurve(functions)
models.feasibility: Broken(name start end value limit)
models.forms.state_space: Equations(frame symbol w v rate)
models.cylinder: cylindrical.<locals>.paper(m2 m3 offset p q theta_bar)
models.frames: coordinate.<locals>.<lambda>(metric q unit) fixed.<locals>.make(frame)
    ldl.<locals>.<lambda>(metric order q) udu.<locals>.<lambda>(metric order q)
    Frame(name q matrix inverse metric vanishes)
models.inverse_kinematics: Configurations(q branches unreachable singular)
models.loads: DriveLoad(name unit peak peak_time rms speed mean_power peak_power peak_braking motor_energy
    brake_energy exceeded overheated) Envelope(peak speed corner continuous power) Exceeded(start end ratio)
models.manipulator: Body(name mass centre orientation inertia) Coordinate(name unit) Drive(name sign) Manipulator(name
    coordinates q v tau metric bodies tool tool_metric skeleton drives frames nominal symbols inertia inverse)
models.mechanics: Mechanics(machine parts) Partials(by_coordinate)
models.motion: Motion(curve start end labels smoothness breaks times smoothed samples notes)
models.parameters: Follows(name factor) Parameter(value) Parameters(entries nominal symbols)
models.piecewise: Piecewise(breaks coefficients)
models.price: Price(effect instructions states controls reason)
models.recording: Recording(t q v a labels notes)
models.samples: Differences(t derivatives)
models.scene: Scene(machine effects form frame system)
models.smoothing: Smoothed(curve noise residual strength freedom knots unit inverse samples) _Fit
models.solution_curve: Recorded SolutionCurve(solution functions parameters labels)
models.splines: Ends(start end periodic)
models.terms: Part(name terms) Quantity(expression unit components) Read(name symbol reader cure) Source(control
    torque invert) State(symbol rate unit initial) Terms(metric potential acceleration bodies force states signals
    symbols nominal limits reads source transmission energy spring dissipation defines) Transmission(motor_tau motor_q
    motor_v torque invert)
models.tool_motion: ToolCurve(tool inverse angular active grid chosen terms)
models.tool_path: Circle(centre first second radius length) Polynomial(curve length) ToolPath
models.torque_table: TorqueTable(t q v a tau machine effects parameters derivative smoothness covariance limits notes)
models.toroid: torus_frames.<locals>.paper=_metric_and_frames.<locals>.paper(above minus p plus root sigma)
    torus_frames.<locals>.root=_metric_and_frames.<locals>.root(g11 q t2 t3)
"""
