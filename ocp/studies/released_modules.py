"""Classes of release 0.1.0; identities of stored studies contain these names.

module: Class(fields of a dataclass) ...

A class that was not in that release counts by its name alone, wherever it lies. A field that was added since counts
only where it differs from its default. See ocp.studies.origins.
"""

RELEASED = """
ocp.adjoint: Adjoint(costates slack moved)
ocp.arcprogramme: ArcProgramme(task arcs elements programme division ties limited solver equations setup)
ocp.arcs: ArcMotion(arcs answer grid arc states controls costates pressures jumps free parameters setup price)
    ArcProblem(problem limits scheme numbers levels singular)
ocp.assembly: Derived(w lam results slopes upper) Local(values arguments inputs linear terms places)
ocp.certificate: Certificate(gap signs crossings jumps released) Crossing(contact start end worst share)
    WrongSign(control start end gain wanted)
ocp.collocation: Control Scheme(name degree control points weights nodes at state rate basis slope_at_start order)
ocp.compilation: Compilation(functions seconds note cached) _HindranceError
ocp.constraint: Constraint(where expression lower upper name) Where
ocp.design: Design LatinHypercube(ranges count seed) Listed(rows) Product(axes) Random(ranges count seed) Sobol(ranges
    count seed) Zip(axes)
ocp.division: Condition(expression size elements tau) Division(arc conditions total near) Near(controls reference size
    weight elements shares)
ocp.equations: Equations(programme places border linear)
ocp.error: Errors(cost duration states dynamics optimality overshoot violation convergence hamiltonian elements local
    drift labels)
ocp.extrapolation: Extrapolation(rtol atol) _Rate _Run
ocp.fixed_step: FixedStep(rule step) _Schedule
ocp.grid: Grid(ends)
ocp.guess: Guess(share x u duration free)
ocp.hamiltonian: Minimum(value least size control)
ocp.influence: Influence(axis slope elasticity effect share)
ocp.integration: Step(x step reached exhausted)
ocp.ipopt: Answer(z multipliers limits cost status verbatim iterations derivatives seconds log) Ipopt(tol max_iter
    max_seconds scaled progress print_level extra) Solver(function watch cost rows) Watch
ocp.kkt: Conditions Evaluation(gradient g jacobian hessian) Linearised(conditions matrix scale shift)
ocp.ladder: CoarseGrid(factor) ParameterPath(name easy steps) Rung Smooth StraightLine WiderLimits(factors)
ocp.layout: Layout(state control horizon free size)
ocp.method: Method Passage(x message evaluations)
ocp.multipliers: Jump(arc contact size) Pressure(arc contact values) Tie(condition arc contact along gradients)
ocp.optima: Optimum(z y s w gaps duals fixed rows error) _Work
ocp.outcome: Outcome(case value error seconds)
ocp.perturbation: Derivative(z y cost gap met moves reason unique) Direction(head bounds)
ocp.piece: Piece(stops control) Polynomial(start width nodes values matrix_at) Sampled(function inset a b nu)
ocp.polishing: _Try
ocp.price: Price
ocp.problem: Bolza(time running final) Fixed(duration) Free(guess lower upper) Problem(system horizon minimise
    subject_to)
ocp.programme: Motion(duration states controls slopes costates multipliers free values) Programme(problem scheme grid
    scaling layout free nlp derivatives defects path ends path_parts ends_parts conditions total compilation sizes)
ocp.reading: Hold(contact start end)
ocp.reconstruction: Reconstruction(programme problem bounds z s y limits head arc shares posed duration)
ocp.record: Record(id parameters status way message results timings origin structure attempts finished host solutions)
ocp.refinement: _Budget
ocp.region: Ball(centre radius) Box(lower upper) Cylinder(centre axis radius length) HalfSpace(point normal) Region
ocp.regularity: Meeting(row at words)
ocp.rule: Rule
ocp.runge_kutta: RadauWithEstimate(order error_order) RungeKutta(tableau)
ocp.scaling: Scaling(x u horizon free cost limits)
ocp.schedule: Progress(total done failed last) _State
ocp.sensitivities: Sensitivity(solution names duration cost free switching valid notes variations seconds
    reconstruction root)
ocp.sequence: Compound(programmes nlp derivatives links) Sequence(problems links sides) SequenceSolution(phases status
    message solver_status cost timings iterations problem)
ocp.simulation: Trajectory(t x u message system values evaluations)
ocp.solution: Accuracy(error tol unit what seconds errors reason) Multipliers(x u path ends) Solution(status message
    solver_status duration cost states controls slopes costates free values timings iterations grid scheme problem
    rung log multipliers accuracy structure) Status Timings(setup derivatives solver total)
ocp.solver: Prepared(problem compound settings setup first cold)
ocp.statelimit: StateLimit(constraint component chain lower upper label state)
ocp.step_control: AdaptiveStep(rule rtol atol) _Attempt
ocp.stiffness: Linearisation
ocp.store: Store StoreError
ocp.structure: Arc(kinds duration held touched) Contact(limit side control) Kind Row Structure(rows arcs)
ocp.study: Study(function over store scheme grid solver polished neighbours checked measure slopes compiled settings)
ocp.study_table: StudyTable(cases records design read)
ocp.succession: PreparedStructure(origin task settings programmes setup)
ocp.sundials: Cvodes(family rtol atol extra) Multistep _Called
ocp.switching: SwitchingFunctions(values gains shares)
ocp.symplectic: StoermerVerlet
ocp.system: Label(name unit) Singularity(quantity least words crossed) System(x u p rate signals nominal labels notes
    limits initial singular)
ocp.tableau: Tableau(name a b order errors error_order)
ocp.tolerance: Cost(tol unit what) Seconds(tol unit what) Share(tol unit what) Signal(name tol unit) Tolerance
ocp.transcription: _Symbols
ocp.trapezoid: PredictorCorrector(corrections)
ocp.variation: Held Variation(states controls seconds p)
ocp.verification: Figure Report(status drift drift_end violation hamiltonian hamiltonian_value hamiltonian_offset
    switching energy excess)
ocp.work: Known(id case content) Task(id case start structure attempts thorough) Work(token function root measure
    scheme grid solver polished neighbours checked slopes compiled) _Found _Here
"""
