"""Types of the requests and answers of fretwork. generate_types.py makes this file from openapi/openapi.json."""

from typing import Any, Literal, NotRequired, TypeAlias, TypedDict

class AccessKey(TypedDict):
    """An access key, without its secret."""

    created: "str"
    expires: "NotRequired[str | None]"
    id: "str"
    last_used: "NotRequired[str | None]"
    name: "str"
    private: "bool"
    requests_per_minute: "NotRequired[int | None]"
    revoked: "NotRequired[str | None]"
    role: "Role"

class AccessKeys(TypedDict):
    """The access keys."""

    keys: "list[AccessKey]"

class Accuracy(TypedDict):
    """The accuracy of the numbers. It does not contain the errors of the theory. For a Poisson's ratio other than 0, local slip and wear vary around the ring, by ±20 % at ν = 0.42. The result is their mean around the ring, which is right."""

    cells: "NotRequired[int]"
    energy_mismatch: "NotRequired[float | None]"
    evaluations: "NotRequired[int]"
    model_error: "NotRequired[float | None]"
    numerical_error: "NotRequired[float | None]"
    steps: "NotRequired[int]"
    wear_depth_error: "NotRequired[float | None]"

Act: TypeAlias = "Literal['add_key', 'revoke_key', 'use_key', 'cancel_job', 'delete_job', 'delete_result', 'rename_job', 'change_note', 'share_names', 'give_names']"

class AmplitudeBlock(TypedDict):
    """A stretch of cycles of one amplitude."""

    amplitude: "Stroke"
    cycles: "BlockCycles"

class ApertureBlock(TypedDict):
    """A stretch of cycles of one aperture of the loop."""

    loop_aperture: "Stroke"
    cycles: "BlockCycles"

class Archard(TypedDict):
    """The wear coefficient of both bodies together as a number without a unit."""

    coefficient: "ArchardCoefficient | ChangeTable | RunIn"
    hardness: "Stress"
    share: "NotRequired[Share]"

ArchardCoefficient: TypeAlias = "float"

class AuditEntry(TypedDict):
    """Equal acts of one day (UTC)."""

    act: "Act"
    actor: "str"
    first: "str"
    key: "NotRequired[str | None]"
    last: "str"
    owner: "NotRequired[str | None]"
    subject: "NotRequired[str | None]"
    times: "int"

class AuditLog(TypedDict):
    """A page of the audit log, the newest entries first."""

    entries: "list[AuditEntry]"
    next: "NotRequired[str | None]"

Auto: TypeAlias = "Literal['auto']"

Axis = TypedDict(
    "Axis",
    {
        "count": "NotRequired[int]",
        "from": "NotRequired[NumberOrText]",
        "spacing": "NotRequired[Spacing]",
        "to": "NotRequired[NumberOrText]",
        "values": "NotRequired[list[NumberOrText]]",
    },
)

Block: TypeAlias = "AmplitudeBlock | ForceBlock | ApertureBlock"

BlockCycles: TypeAlias = "float"

BlockForce: TypeAlias = "float | str"

class Blocks(TypedDict):
    """Amplitudes one after the other."""

    blocks: "list[Block]"
    held: "NotRequired[Literal['amplitude', 'tangential_force']]"
    rig_stiffness: "NotRequired[Stiffness]"
    reference_distance: "NotRequired[Length]"
    loop_stiffness: "NotRequired[Stiffness]"

class BodiesAndLayers(TypedDict):
    """The wear coefficients of each body. Bodies without layers are the same as `coefficient` with `share`."""

    bodies: "list[WornBody]"

class Body(TypedDict):
    """One isotropic elastic body."""

    youngs_modulus: "Stress"
    poisson_ratio: "PoissonRatio"
    yield_strength: "NotRequired[Stress]"

class BodySum(TypedDict):
    """Size and digest of a result."""

    bytes: "int"
    sha256: "str"

class BodyWear(TypedDict):
    """The wear of one body. The first body carries the profile; the other one is the counterbody."""

    scar_half_length: "list[float]"
    share: "NotRequired[float]"
    wear_depth: "NotRequired[list[float]]"
    wear_volume: "NotRequired[list[float]]"

class ByAmplitude(TypedDict):
    """A given amplitude."""

    amplitude: "Length"
    held: "NotRequired[Literal['amplitude', 'tangential_force']]"
    rig_stiffness: "NotRequired[Stiffness]"
    reference_distance: "NotRequired[Length]"
    loop_stiffness: "NotRequired[Stiffness]"

class ByAperture(TypedDict):
    """A given aperture of the friction loop."""

    loop_aperture: "Length"
    rig_stiffness: "NotRequired[Stiffness]"
    reference_distance: "NotRequired[Length]"
    loop_stiffness: "NotRequired[Stiffness]"

class ByDepth(TypedDict):
    """The depth of the unworn contact."""

    indentation_depth: "Length"
    held: "NotRequired[Literal['force', 'depth']]"

class ByForce(TypedDict):
    """The force of the unworn contact."""

    normal_force: "Force"
    held: "NotRequired[Literal['force', 'depth']]"

class ByStickRatio(TypedDict):
    """A given stick ratio."""

    stick_ratio: "StickRatio"
    held: "NotRequired[Literal['amplitude', 'tangential_force']]"
    rig_stiffness: "NotRequired[Stiffness]"
    reference_distance: "NotRequired[Length]"
    loop_stiffness: "NotRequired[Stiffness]"

class ByTangentialForce(TypedDict):
    """A given tangential force."""

    tangential_force: "TangentialForce"
    held: "NotRequired[Literal['amplitude', 'tangential_force']]"
    rig_stiffness: "NotRequired[Stiffness]"
    reference_distance: "NotRequired[Length]"
    loop_stiffness: "NotRequired[Stiffness]"

class CallerLimits(TypedDict):
    """The limits of a key; null is no limit."""

    evaluations_per_minute: "NotRequired[int | None]"
    requests_at_once: "NotRequired[int | None]"
    requests_per_minute: "NotRequired[int | None]"

class CallerUsage(TypedDict):
    """The use of the limits, and the unfinished jobs of the caller."""

    jobs_queued: "int"
    jobs_running: "int"
    requests_left: "NotRequired[int | None]"

class CanceledJobs(TypedDict):
    """The number of canceled jobs."""

    canceled: "int"

Cell: TypeAlias = "float | str | None"

class ChangeTable(TypedDict):
    """A coefficient that changes during the run. It is linear between the rows, and constant before the first row and after the last one. A table of equal values is the same as the number."""

    over: "Literal['cycles', 'dissipated_energy']"
    at: "list[float | str]"
    values: "list[float | str]"

Checked: TypeAlias = "CheckedRun | CheckedStudy"

class CheckedLinks(TypedDict):
    """Addresses related to a checked scenario."""

    result: "str"
    submit: "str"

class CheckedRun(TypedDict):
    """What is known of a scenario without a run."""

    cost: "RunCost"
    limit: "Limit | None"
    regime: "Regime"
    scales: "Scales"
    units: "Units"
    unworn: "Unworn"
    cached: "bool"
    excess: "NotRequired[str | None]"
    key: "str"
    links: "CheckedLinks"
    scenario: "dict[str, Any]"
    time: "CheckedTime"
    warnings: "list[Warning]"

CheckedStudy: TypeAlias = "dict[str, Any]"

class CheckedTime(TypedDict):
    """How long a run or a study takes, and may take."""

    limit: "NotRequired[float | None]"
    seconds: "float"

ChosenInstants: TypeAlias = "list[float]"

class Columns(TypedDict):
    """One array per quantity, all of the same length. Entry 0 is the unworn state. A run that ends early has fewer entries than requested."""

    actuator_gross_slip_amplitude: "NotRequired[list[float | None]]"
    amplitude: "NotRequired[list[float | None]]"
    contact_radius: "NotRequired[list[float]]"
    cycles: "list[float]"
    dissipated_energy: "NotRequired[list[float]]"
    energy_per_cycle: "NotRequired[list[float]]"
    gross_slip_amplitude: "NotRequired[list[float | None]]"
    indentation_depth: "NotRequired[list[float | None]]"
    normal_force: "NotRequired[list[float]]"
    normalized_cycles: "NotRequired[list[float]]"
    scar_radius: "NotRequired[list[float]]"
    stick_radius: "NotRequired[list[float]]"
    tangential_force: "NotRequired[list[float]]"
    wear_depth: "NotRequired[list[float]]"
    wear_depth_error: "NotRequired[list[float]]"
    wear_volume: "NotRequired[list[float]]"
    wear_volume_error: "NotRequired[list[float]]"

Comments: TypeAlias = "Literal['all', 'none']"

class CommonCurves(TypedDict):
    """The curves of each point of a sweep after its last output cycle, at radii that all points share. A value is null where the point has no run, and next to an infinite value. Beyond the radii of the run, `worn` and `slip` are null, `wear` and `pressure` 0."""

    point: "list[int]"
    pressure: "NotRequired[list[list[float | None]]]"
    radius: "list[float]"
    slip: "NotRequired[list[list[float | None]]]"
    wear: "NotRequired[list[list[float | None]]]"
    worn: "NotRequired[list[list[float | None]]]"

class Comparison(TypedDict):
    """The simplified rule for the same scenario, if `compare` was requested."""

    best_error: "float | None"
    best_xi: "float | None"
    errors: "Errors"
    history: "Columns"
    xi: "float"

class Complaint(TypedDict):
    """One fault of a request."""

    detail: "str"
    parameter: "NotRequired[str | None]"
    pointer: "NotRequired[str | None]"

class Computation(TypedDict):
    """Who computed a result, when, and how long it took."""

    at: "NotRequired[str | None]"
    cpu_seconds: "NotRequired[float | None]"
    job: "NotRequired[str | None]"
    owner: "NotRequired[str | None]"
    request: "NotRequired[str | None]"
    wall_seconds: "NotRequired[float | None]"

class Cone(TypedDict):
    """f = r·tan θ."""

    shape: "Literal['cone']"
    slope_angle: "SlopeAngle"

class Counts(TypedDict):
    """How many points a study has, and how many of them lack outputs."""

    incomplete: "int"
    points: "int"
    refused: "int"

class CreatedKey(TypedDict):
    """A new access key."""

    access_key: "str"
    id: "str"

class CrossedCylinders(TypedDict):
    """Two cylinders with perpendicular axes, one of them along the motion. If the ratio of their radii is at most 1.5, the contact is computed as round."""

    shape: "Literal['crossed_cylinders']"
    radii: "list[Length]"

class Curves(TypedDict):
    """Profiles over the radius; null if none were requested. Row 0 of every matrix is the unworn state."""

    cycles: "list[float]"
    image: "NotRequired[list[list[float]]]"
    initial: "NotRequired[list[float]]"
    limiting: "NotRequired[list[float | None] | None]"
    pressure: "NotRequired[list[list[float | None]]]"
    radius: "list[float]"
    slip: "NotRequired[list[list[float]]]"
    wear: "NotRequired[list[list[float]]]"
    worn: "NotRequired[list[list[float]]]"

Cycles: TypeAlias = "Instants | Range | Normalized | EnergyCycles"

class Cylinder(TypedDict):
    """A line contact: f = x²/(2R), a cylinder whose axis lies across the motion."""

    shape: "Literal['cylinder']"
    radius: "Length"
    length: "Length"

class Derivative(TypedDict):
    """The derivative of an output with respect to a number of the scenario."""

    error: "NotRequired[float | None]"
    method: "DerivativeMethod"
    output: "str"
    parameter: "str"
    reason: "NotRequired[str | None]"
    unit: "str"
    value: "NotRequired[float | None]"

class DerivativeList(TypedDict):
    """The derivatives of a result."""

    derivatives: "list[Derivative]"
    key: "str"
    numerics: "int"

DerivativeMethod: TypeAlias = "Literal['closed', 'numerical']"

Design: TypeAlias = "Literal['grid', 'zip', 'latin_hypercube', 'sobol']"

class Diff(TypedDict):
    """The differences of two results or scenarios."""

    a: "SideAnswer"
    b: "SideAnswer"
    omitted: "int"
    outputs: "NotRequired[list[OutputDifference] | None]"
    parameters: "list[ParameterDifference]"
    remarks: "list[str]"
    same_scenario: "bool"
    units: "dict[str, Any]"

DiffBody: TypeAlias = "KeysToCompare | SidesToCompare"

class DiffSide(TypedDict):
    """A result by its key, which may be evicted, or a scenario."""

    key: "NotRequired[KeyText]"
    scenario: "NotRequired[Scenario]"

DissipatedEnergy: TypeAlias = "float | str"

class Distribution(TypedDict):
    """The name of a distribution with its parameters, in the unit of the number."""

    log_uniform: "NotRequired[UniformDistribution]"
    lognormal: "NotRequired[LognormalDistribution]"
    normal: "NotRequired[NormalDistribution]"
    triangular: "NotRequired[TriangularDistribution]"
    uniform: "NotRequired[UniformDistribution]"

EitherCurves: TypeAlias = "Curves | CommonCurves"

Energies: TypeAlias = "list[DissipatedEnergy]"

class EnergyCycles(TypedDict):
    dissipated_energy: "Energies | EnergyRange"

class EnergyLine(TypedDict):
    energy_coefficient: "float | None"
    interval: "list[float | None]"
    r_squared: "float | None"
    standard_error: "float | None"
    weights: "LineWeights"

EnergyRange = TypedDict(
    "EnergyRange",
    {
        "from": "DissipatedEnergy",
        "to": "DissipatedEnergy",
        "count": "int",
        "spacing": "NotRequired[Literal['log', 'linear']]",
    },
)

EnergyWear: TypeAlias = "float | str"

class EnergyWearCoefficient(TypedDict):
    """The wear volume of both bodies together per dissipated energy."""

    energy_coefficient: "EnergyWear"
    share: "NotRequired[Share]"

class Engine(TypedDict):
    """The engine that computed the result."""

    name: "str"
    numerics: "int"

class Errors(TypedDict):
    """Rule/exact − 1 at each output cycle that both histories have; 0 where both are 0."""

    dissipated_energy: "list[float]"
    indentation_depth: "list[float]"
    normal_force: "list[float]"
    wear_depth: "list[float]"
    wear_volume: "list[float]"

EstimatedParameter = TypedDict(
    "EstimatedParameter",
    {
        "at_bound": "bool",
        "estimate": "float | None",
        "for": "NotRequired[list[str]]",
        "interval": "list[float | None]",
        "pointer": "str",
        "standard_error": "float | None",
        "unit": "str",
    },
)

class EvaluateBody(TypedDict):
    """A scenario to evaluate, and what to return. At least one of `outputs` and `parts` must have an item."""

    outputs: "NotRequired[list[OutputName]]"
    parts: "NotRequired[list[EvaluatedPart]]"
    scenario: "Scenario"

class Evaluated(TypedDict):
    """The outputs of a scenario, in SI units. The numbers are those of the result that a job of this scenario has."""

    accuracy: "NotRequired[Accuracy]"
    check: "NotRequired[CheckedRun]"
    events: "NotRequired[list[Event]]"
    history: "NotRequired[Columns]"
    loops: "NotRequired[LoopCurves | None]"
    outputs: "dict[str, float | None]"
    profiles: "NotRequired[Curves | None]"
    reasons: "NotRequired[dict[str, str]]"
    units: "Units"
    warnings: "list[Warning]"

EvaluatedPart: TypeAlias = "Literal['history', 'profiles', 'loops', 'events', 'accuracy', 'check']"

class Event(TypedDict):
    """An event during the run."""

    body: "NotRequired[int]"
    cycles: "float"
    kind: "EventKind"
    layer: "NotRequired[int]"
    radius: "NotRequired[float]"

EventKind: TypeAlias = "Literal['gross_slip', 'contact_lost', 'shakedown', 'until_reached', 'rim_reached', 'contact_splits', 'layer_worn_through', 'energy_not_reached', 'core_slips']"

class ExampleAnswer(TypedDict):
    """An example."""

    body: "dict[str, Any]"
    label: "str"
    name: "str"

Exponent: TypeAlias = "float"

File: TypeAlias = "str"

class Fit(TypedDict):
    """A fit of numbers of a scenario to measurements."""

    confidence: "NotRequired[float]"
    loss: "NotRequired[Loss]"
    parameters: "list[FitParameter]"
    scenario: "Scenario"
    starts: "NotRequired[int]"
    tests: "list[FitTest]"
    version: "NotRequired[int]"
    without: "NotRequired[list[str]]"

class FitNote(TypedDict):
    detail: "str"
    kind: "str"

class FitOutlier(TypedDict):
    pointer: "str"
    row: "int"
    studentized: "float"

FitParameter = TypedDict(
    "FitParameter",
    {
        "for": "NotRequired[list[str]]",
        "from": "NumberOrText",
        "pointer": "str",
        "prior": "NotRequired[dict[str, Any]]",
        "spacing": "NotRequired[Spacing]",
        "start": "NotRequired[NumberOrText]",
        "to": "NumberOrText",
    },
)

class FitQuality(TypedDict):
    """How well the parameters describe the measurements."""

    aicc: "NotRequired[float | None]"
    allowed_rise: "NotRequired[float | None]"
    degrees_of_freedom: "NotRequired[int | None]"
    effective_points: "float | None"
    lack_of_fit: "NotRequired[dict[str, Any] | None]"
    noise: "NotRequired[list[dict[str, Any]]]"
    runs: "float"
    sum_of_squares: "float | None"

class FitResult(TypedDict):
    """The result of a fit. Without a minimum it has only notes, the measured numbers and the searches."""

    bands: "NotRequired[TableColumns]"
    correlation: "NotRequired[list[list[float | None]]]"
    counts: "Counts"
    engine: "Engine"
    estimated_scenario: "NotRequired[dict[str, Any]]"
    fit: "Fit"
    key: "KeyText"
    lines: "NotRequired[list[EnergyLine]]"
    notes: "list[FitNote]"
    outliers: "NotRequired[list[FitOutlier]]"
    parameters: "NotRequired[list[EstimatedParameter]]"
    quality: "NotRequired[FitQuality]"
    searches: "TableColumns"
    table: "TableColumns"
    units: "Units"

class FitTest(TypedDict):
    """A test: how its scenario differs, and what was measured."""

    changes: "NotRequired[dict[str, Any]]"
    data: "list[MeasuredSet]"
    name: "NotRequired[str]"
    specimen: "NotRequired[str]"

Force: TypeAlias = "float | str"

class ForceBlock(TypedDict):
    """A stretch of cycles of one amplitude of the tangential force."""

    tangential_force: "BlockForce"
    cycles: "BlockCycles"

class FrettingMap(TypedDict):
    """A map over normal force and amplitude. Its scenario has both."""

    amplitude: "Axis"
    normal_force: "Axis"
    outputs: "NotRequired[list[OutputName]]"
    scenario: "Scenario"
    version: "NotRequired[int]"

Friction: TypeAlias = "float"

Geometry: TypeAlias = "Literal['round', 'line']"

class Health(TypedDict):
    """The health of the process."""

    status: "str"

Height: TypeAlias = "float | str"

class Histogram(TypedDict):
    """Distributions of the outputs of a study, in columns with one row per bin: `output`, `unit`, `from`, `to` and `points`."""

    engine: "Engine"
    histogram: "TableColumns"
    key: "KeyText"
    units: "Units"

HistogramAnswer: TypeAlias = "Histogram | Records"

class History(TypedDict):
    """The history of a result."""

    engine: "Engine"
    history: "Columns"
    key: "KeyText"
    units: "Units"

HistoryAnswer: TypeAlias = "History | Records"

HistoryFields: TypeAlias = "list[Literal['cycles', 'normalized_cycles', 'wear_volume', 'wear_depth', 'scar_radius', 'contact_radius', 'stick_radius', 'normal_force', 'indentation_depth', 'amplitude', 'tangential_force', 'energy_per_cycle', 'dissipated_energy', 'wear_volume_error', 'wear_depth_error']]"

Import = TypedDict(
    "Import",
    {
        "at": "str",
        "from": "str",
        "verified": "NotRequired[str | None]",
        "verified_rows": "NotRequired[int | None]",
    },
)

Include: TypeAlias = "list[Literal['result', 'scenario', 'submitted']]"

Instant: TypeAlias = "float"

Instants: TypeAlias = "list[Instant]"

class Job(TypedDict):
    """A job: one submission and its progress."""

    attempt: "int"
    error: "NotRequired[JobError | None]"
    id: "str"
    key: "str"
    label: "NotRequired[str | None]"
    links: "Links"
    origin: "Origin"
    owner: "str"
    priority: "int"
    private: "bool"
    progress: "float"
    recomputed: "NotRequired[Recomputed | None]"
    state: "JobState"
    summary: "NotRequired[dict[str, Any] | None]"
    tags: "list[str]"
    times: "Times"
    warnings: "list[Warning]"
    scenario: "NotRequired[Scenario | None]"
    sweep: "NotRequired[Sweep]"
    sensitivity: "NotRequired[Sensitivity]"
    map: "NotRequired[FrettingMap]"
    fit: "NotRequired[Fit]"
    result: "NotRequired[Result | None]"

class JobBody(TypedDict):
    """What to compute, exactly one of `scenario`, `sweep`, `sensitivity`, `map` and `fit`, and words to find the job by."""

    fit: "NotRequired[Fit]"
    label: "NotRequired[str]"
    map: "NotRequired[FrettingMap]"
    private: "NotRequired[bool]"
    scenario: "NotRequired[Scenario]"
    sensitivity: "NotRequired[Sensitivity]"
    sweep: "NotRequired[Sweep]"
    tags: "NotRequired[list[Tag]]"

class JobError(TypedDict):
    """Why a job failed."""

    detail: "str"
    title: "str"
    type: "str"

class JobEvent(TypedDict):
    """One of the events that follow a job."""

    data: "str"
    event: "JobEventKind"
    id: "NotRequired[str]"

JobEventKind: TypeAlias = "Literal['snapshot', 'state', 'progress']"

class JobList(TypedDict):
    """A page of jobs."""

    jobs: "list[Job]"
    next: "NotRequired[str | None]"
    total: "NotRequired[int | None]"

JobOrder: TypeAlias = "Literal['-created', 'created']"

JobState: TypeAlias = "Literal['queued', 'running', 'canceling', 'succeeded', 'failed', 'canceled']"

class KeyBody(TypedDict):
    """An access key to be made."""

    expires_in: "NotRequired[str]"
    name: "str"
    private: "NotRequired[bool]"
    requests_per_minute: "NotRequired[int]"
    role: "Role"

KeyText: TypeAlias = "str"

class KeysToCompare(TypedDict):
    """Two keys."""

    keys: "list[KeyText]"

class Layer(TypedDict):
    """A layer on a body."""

    thickness: "Length"
    coefficient: "WearRate"

Layout: TypeAlias = "Literal['columns', 'records']"

Length: TypeAlias = "float | str"

class Limit(TypedDict):
    """The limiting state for many cycles; null without a closed form."""

    contact_radius: "NotRequired[float]"
    indentation_depth: "NotRequired[float | None]"
    normal_force: "NotRequired[float]"
    stick_radius: "NotRequired[float]"
    tangential_force: "NotRequired[float]"
    wear_depth: "NotRequired[float]"
    wear_depth_radius: "NotRequired[float]"
    wear_volume: "NotRequired[float]"

class Limits(TypedDict):
    """The limits of a request."""

    answer_bytes: "int"
    body_bytes: "int"
    call_seconds: "int"
    cycles: "int"
    evaluate_seconds: "float"
    points: "list[int]"
    study_bytes: "int"
    study_points: "int"
    study_seconds: "NotRequired[int | None]"
    wait_seconds: "int"

LineWeights: TypeAlias = "Literal['equal', 'noise']"

class Links(TypedDict):
    """Addresses related to a job."""

    cancel: "NotRequired[str | None]"
    events: "str"
    result: "str"
    self: "str"

ListFormat: TypeAlias = "Literal['json', 'csv']"

Load: TypeAlias = "ByForce | ByDepth"

class LognormalDistribution(TypedDict):
    """Of its mean and standard deviation, or of its median and the factor by which one standard deviation of the logarithm multiplies it."""

    factor: "NotRequired[float]"
    mean: "NotRequired[NumberOrText]"
    median: "NotRequired[NumberOrText]"
    standard_deviation: "NotRequired[NumberOrText]"

class LoopCurves(TypedDict):
    """Force–displacement loops at the output cycles of the profiles. A loop is one cycle and has a point wherever another spring starts to slip, so that straight lines between the points enclose `energy_per_cycle`. Loops may differ in their number of points. Null if no profiles were requested."""

    actuator_energy_ratio: "NotRequired[list[float]]"
    actuator_slip_ratio: "NotRequired[list[float]]"
    cycles: "list[float]"
    displacement: "NotRequired[list[list[float | None]]]"
    energy_ratio: "NotRequired[list[float | None]]"
    free_ratio: "NotRequired[list[float]]"
    slip_ratio: "NotRequired[list[float | None]]"
    tangential_force: "NotRequired[list[list[float]]]"

LoopFields: TypeAlias = "list[Literal['cycles', 'displacement', 'tangential_force', 'energy_ratio', 'slip_ratio', 'free_ratio']]"

class Loops(TypedDict):
    """The force–displacement loops of a result."""

    engine: "Engine"
    key: "KeyText"
    loops: "LoopCurves"
    units: "Units"

LoopsAnswer: TypeAlias = "Loops | Records"

Loss: TypeAlias = "Literal['squares', 'huber']"

MapBoundary = TypedDict(
    "MapBoundary",
    {
        "/load/normal_force": "list[float]",
        "/motion/amplitude": "list[float | None]",
        "after_run": "NotRequired[list[float | None]]",
        "unworn.gross_slip_amplitude": "NotRequired[list[float | None]]",
    },
)

class MapResult(TypedDict):
    """The result of a map."""

    boundary: "MapBoundary"
    counts: "Counts"
    engine: "Engine"
    key: "KeyText"
    map: "FrettingMap"
    table: "TableColumns"
    units: "Units"

class Me(TypedDict):
    """The caller, with its limits and their use."""

    key: "NotRequired[str | None]"
    limits: "CallerLimits"
    name: "str"
    private: "bool"
    role: "Role"
    usage: "CallerUsage"

class Measured(TypedDict):
    """What was read from a file of measured numbers."""

    columns: "list[MeasuredColumn]"
    notes: "list[str]"
    prepared: "Prepared | None"
    tables: "list[list[int]]"

MeasuredCell: TypeAlias = "float | str | None"

class MeasuredColumn(TypedDict):
    dimension: "str | None"
    name: "str"
    unit: "str | None"
    values: "list[float | None]"

class MeasuredLoops(TypedDict):
    """For a loop: a table with a row for each whole cycle."""

    aperture: "list[float | None]"
    displacement_amplitude: "list[float | None]"
    energy: "list[float | None]"
    energy_error: "list[float | None]"
    force_amplitude: "list[float | None]"
    points: "list[float | None]"
    slope: "list[float | None]"
    slope_error: "list[float | None]"

MeasuredOver: TypeAlias = "Literal['cycles', 'dissipated_energy']"

class MeasuredPoints(TypedDict):
    """Measured numbers over cycles or dissipated energies."""

    density: "NotRequired[float]"
    noise: "NotRequired[Noise]"
    output: "str"
    over: "NotRequired[MeasuredOver]"
    relative: "NotRequired[float]"
    sigma: "NotRequired[Sigma]"
    x: "list[NumberOrText]"
    y: "list[MeasuredCell]"

MeasuredProfile: TypeAlias = "Literal['wear']"

MeasuredSet: TypeAlias = "MeasuredPoints | WearProfile"

class Model(TypedDict):
    """How wear is computed."""

    method: "NotRequired[Literal['exact', 'simplified']]"
    xi: "NotRequired[Auto | Xi]"
    tolerance: "NotRequired[Tolerance]"
    compare: "NotRequired[bool]"
    points: "NotRequired[int]"

class Moduli(TypedDict):
    """The effective moduli of the pair. Give these or `bodies`."""

    normal: "Stress"
    tangential: "NotRequired[Stress]"

Motion: TypeAlias = "ByAmplitude | Sliding | ByAperture | ByStickRatio | ByTangentialForce | Blocks | Reversals"

class Naming(TypedDict):
    """A change of the label, the tags and the privacy of a job."""

    label: "NotRequired[str | None]"
    private: "NotRequired[bool]"
    tags: "NotRequired[list[Tag]]"

Noise: TypeAlias = "str | RelativeNoise"

NoiseKind: TypeAlias = "Literal['normal', 'lognormal']"

class NormalDistribution(TypedDict):
    mean: "NumberOrText"
    standard_deviation: "NumberOrText"

class Normalized(TypedDict):
    normalized: "Instants | Range"

class Note(TypedDict):
    """What a user wrote about a result."""

    at: "str"
    etag: "str"
    owner: "str"
    private: "bool"
    text: "str"

class NoteBody(TypedDict):
    """A note on a result."""

    text: "str"

NumberList: TypeAlias = "list[NumberOrText]"

NumberOrText: TypeAlias = "float | str"

NumberRange = TypedDict(
    "NumberRange",
    {
        "count": "int",
        "from": "NumberOrText",
        "spacing": "NotRequired[Spacing]",
        "to": "NumberOrText",
    },
)

Order: TypeAlias = "Literal['created', '-created', 'size', '-size', 'friction', '-friction', 'normal_modulus', '-normal_modulus', 'tangential_modulus', '-tangential_modulus', 'wear_coefficient', '-wear_coefficient', 'radius', '-radius', 'slope_angle', '-slope_angle', 'flat_radius', '-flat_radius', 'exponent', '-exponent', 'normal_force', '-normal_force', 'indentation_depth', '-indentation_depth', 'contact_radius', '-contact_radius', 'stick_radius', '-stick_radius', 'amplitude', '-amplitude', 'gross_slip_amplitude', '-gross_slip_amplitude', 'tangential_force', '-tangential_force', 'rig_stiffness', '-rig_stiffness', 'points', '-points', 'cycles', '-cycles', 'wear_volume', '-wear_volume', 'wear_depth', '-wear_depth', 'scar_radius', '-scar_radius', 'dissipated_energy', '-dissipated_energy']"

Origin: TypeAlias = "Literal['computed', 'coalesced', 'cached']"

class OutputDifference(TypedDict):
    """An output of both results."""

    a: "dict[str, Any]"
    b: "dict[str, Any]"
    name: "str"
    relative: "NotRequired[float | None]"

OutputName: TypeAlias = "str"

class Paraboloid(TypedDict):
    """f = r²/(2R): the usual stand-in for a ball."""

    shape: "Literal['paraboloid']"
    radius: "Length"

class ParameterDifference(TypedDict):
    """A parameter that differs."""

    a: "dict[str, Any]"
    b: "dict[str, Any]"
    pointer: "str"
    relative: "NotRequired[float | None]"

PlotInstants: TypeAlias = "list[float]"

PlotKind: TypeAlias = "Literal['curves', 'scatter', 'heat', 'regimes', 'tornado', 'bands', 'residuals', 'energy', 'profile']"

PlotQuantity: TypeAlias = "Literal['worn', 'wear', 'image', 'pressure', 'slip', 'wear_volume', 'wear_depth', 'scar_radius', 'contact_radius', 'stick_radius', 'normal_force', 'indentation_depth', 'amplitude', 'tangential_force', 'energy_per_cycle', 'dissipated_energy', 'wear_volume_error', 'wear_depth_error', 'gross_slip_amplitude', 'actuator_gross_slip_amplitude', 'loops']"

PoissonRatio: TypeAlias = "float"

Position: TypeAlias = "float | str"

class PowerLaw(TypedDict):
    """f = height·(r/at_radius)^exponent. For a line contact, r is the distance from the middle, and `length` is required."""

    shape: "Literal['power']"
    exponent: "Exponent"
    height: "Length"
    at_radius: "Length"
    geometry: "NotRequired[Geometry]"
    length: "NotRequired[Length]"

Prepare: TypeAlias = "Literal['points', 'trace', 'half', 'loop']"

class Prepared(TypedDict):
    """What was made from x and y. Null if the file has only one column."""

    cycles: "NotRequired[int]"
    data: "NotRequired[dict[str, Any] | None]"
    energy_per_cycle: "NotRequired[float]"
    indenter: "NotRequired[dict[str, Any] | None]"
    loops: "NotRequired[MeasuredLoops]"
    mean: "NotRequired[dict[str, float | None]]"
    trace: "NotRequired[dict[str, Any]]"

class Preview(TypedDict):
    """An estimate for a scenario."""

    cost: "RunCost"
    limit: "Limit | None"
    regime: "Regime"
    scales: "Scales"
    units: "Units"
    unworn: "Unworn"

class Problem(TypedDict):
    """Every error, as the server writes it (RFC 9457)."""

    detail: "str"
    errors: "NotRequired[list[Complaint]]"
    instance: "str"
    status: "int"
    title: "str"
    type: "str"
    scenario: "NotRequired[dict[str, Any]]"
    sweep: "NotRequired[dict[str, Any]]"
    sensitivity: "NotRequired[dict[str, Any]]"
    map: "NotRequired[dict[str, Any]]"
    fit: "NotRequired[dict[str, Any]]"

Profile: TypeAlias = "Paraboloid | Sphere | Cone | PowerLaw | TruncatedParaboloid | TruncatedCone | CrossedCylinders | Cylinder | Wedge | Punch | Table"

ProfileFields: TypeAlias = "list[Literal['cycles', 'radius', 'initial', 'limiting', 'worn', 'wear', 'image', 'pressure', 'slip']]"

class Profiles(TypedDict):
    """The profiles of a result."""

    engine: "Engine"
    key: "KeyText"
    profiles: "EitherCurves"
    units: "Units"

ProfilesAnswer: TypeAlias = "Profiles | Records"

ProfilesAt: TypeAlias = "Literal['all', 'last', 'none'] | Instants"

class Program(TypedDict):
    """A version of the program on a machine."""

    architecture: "NotRequired[str | None]"
    host: "NotRequired[str | None]"
    numerics: "int"
    processors: "NotRequired[int | None]"
    version: "str"

class Provenance(TypedDict):
    """Who computed a result, when, and with which program. Values that the server does not know are null."""

    body: "BodySum"
    computed: "Computation"
    created: "str"
    deleted_by: "NotRequired[str | None]"
    evicted: "NotRequired[str | None]"
    imported: "NotRequired[Import | None]"
    jobs: "int"
    key: "str"
    last_access: "str"
    note: "NotRequired[Note | None]"
    pinned: "bool"
    pinned_by: "NotRequired[str | None]"
    program: "NotRequired[Program | None]"
    warnings: "NotRequired[list[Warning] | None]"

class Punch(TypedDict):
    """A line contact: f = (|x|−b)²/(2R) for |x| > b, flat inside. A flat punch with rounded edges, as in tests of fretting fatigue."""

    shape: "Literal['punch']"
    flat_half_width: "Length"
    edge_radius: "Length"
    length: "Length"

Radii: TypeAlias = "NumberList | NumberRange"

Radius: TypeAlias = "float | str"

Range = TypedDict(
    "Range",
    {
        "from": "Instant",
        "to": "Instant",
        "count": "int",
        "spacing": "NotRequired[Literal['log', 'linear']]",
    },
)

class Readiness(TypedDict):
    """Whether the server can accept jobs."""

    oldest_seconds: "float"
    queued: "int"
    status: "str"

Recomputed: TypeAlias = "Literal['same', 'differs', 'replaced']"

class Records(TypedDict):
    """A table in rows: one object per output cycle, or per output cycle and point."""

    engine: "Engine"
    key: "KeyText"
    records: "list[dict[str, Cell]]"
    units: "Units"

Regime: TypeAlias = "Literal['full_stick', 'partial_slip', 'gross_slip']"

class RelativeNoise(TypedDict):
    """Noise that is a share of the true number."""

    kind: "NotRequired[NoiseKind]"
    relative: "NotRequired[float]"

Result: TypeAlias = "RunResult | SweepResult | SensitivityResult | MapResult | FitResult"

class ResultEntry(TypedDict):
    """A result in a list, with its most important inputs and outputs in SI."""

    kind: "NotRequired[Literal['run', 'sweep', 'sensitivity', 'map', 'fit', None]]"
    shape: "NotRequired[Literal['paraboloid', 'sphere', 'cone', 'power', 'truncated_paraboloid', 'truncated_cone', 'table', 'crossed_cylinders', 'cylinder', 'wedge', 'punch', None]]"
    geometry: "NotRequired[Literal['round', 'line', None]]"
    method: "NotRequired[Literal['simplified', 'exact', None]]"
    regime: "NotRequired[Literal['full_stick', 'partial_slip', 'gross_slip', None]]"
    held: "NotRequired[Literal['depth', 'force', None]]"
    motion: "NotRequired[Literal['amplitude', 'tangential_force', 'rig', 'blocks', 'reversals', 'sliding', 'aperture', None]]"
    created: "str"
    design: "NotRequired[str | None]"
    evicted: "NotRequired[str | None]"
    job: "NotRequired[str | None]"
    key: "str"
    label: "NotRequired[str | None]"
    link: "str"
    note: "NotRequired[Note | None]"
    owner: "NotRequired[str | None]"
    pinned: "bool"
    size: "int"
    submitted_by: "NotRequired[str | None]"
    tags: "list[str]"
    values: "dict[str, float | None]"

class ResultList(TypedDict):
    """A page of results."""

    next: "NotRequired[str | None]"
    results: "list[ResultEntry]"
    total: "NotRequired[int | None]"
    units: "dict[str, Any]"

class Reversals(TypedDict):
    """A displacement record."""

    reversals: "list[Position]"
    held: "NotRequired[Literal['amplitude']]"

Role: TypeAlias = "Literal['read', 'submit', 'admin']"

class RunCost(TypedDict):
    """An estimate of the cost of a run."""

    answer_bytes: "int"
    operations: "float"

class RunIn(TypedDict):
    """Short form of a table with two rows: the coefficient goes from `from` to `to` in the first `cycles`, and stays there."""

    run_in: "RunInRunIn"

RunInRunIn = TypedDict(
    "RunInRunIn",
    {
        "cycles": "BlockCycles",
        "from": "float | str",
        "to": "float | str",
    },
)

class RunResult(TypedDict):
    """The result of a scenario, in SI units."""

    accuracy: "Accuracy"
    bodies: "NotRequired[list[BodyWear]]"
    comparison: "NotRequired[Comparison]"
    engine: "Engine"
    events: "list[Event]"
    history: "Columns"
    key: "KeyText"
    limit: "Limit | None"
    loops: "LoopCurves | None"
    profiles: "Curves | None"
    regime: "Regime"
    scales: "Scales"
    scenario: "dict[str, Any]"
    units: "Units"
    unworn: "Unworn"
    warnings: "list[Warning]"

class RunSoFar(TypedDict):
    """The rows of a run that is being computed."""

    history: "Columns"
    units: "dict[str, Any]"

class Scales(TypedDict):
    """The scales of the unworn contact. All results are multiples of them."""

    contact_radius: "float"
    cycles: "float"
    indentation_depth: "float"
    normal_force: "float"

class Scenario(TypedDict):
    """One fretting contact and how long it is worn. Quantities are numbers in SI, or strings with a unit."""

    profile: "Profile"
    bodies: "NotRequired[list[Body]]"
    moduli: "NotRequired[Moduli]"
    friction: "Friction | ChangeTable | RunIn"
    wear: "Wear"
    load: "Load"
    motion: "Motion"
    cycles: "Cycles"
    profiles_at: "NotRequired[ProfilesAt]"
    until: "NotRequired[Until]"
    model: "NotRequired[Model]"

class Sensitivity(TypedDict):
    """A sensitivity study: which numbers of a scenario matter for its outputs."""

    confidence: "NotRequired[float]"
    method: "NotRequired[SensitivityMethod]"
    outputs: "list[OutputName]"
    samples: "NotRequired[int]"
    scenario: "Scenario"
    seed: "NotRequired[int]"
    vary: "list[Varied]"
    version: "NotRequired[int]"

SensitivityMethod: TypeAlias = "Literal['sobol', 'morris', 'local']"

class SensitivityNote(TypedDict):
    detail: "str"
    member: "NotRequired[str]"
    output: "str"

class SensitivityResult(TypedDict):
    """The result of a sensitivity study."""

    counts: "Counts"
    engine: "Engine"
    key: "KeyText"
    notes: "list[SensitivityNote]"
    samples: "TableColumns"
    sensitivity: "Sensitivity"
    table: "TableColumns"
    units: "Units"

Share: TypeAlias = "float"

class SharedLink(TypedDict):
    """A link to a result."""

    expires: "str"
    url: "str"

class SideAnswer(TypedDict):
    """One side of the comparison."""

    key: "str"
    link: "str"
    numerics: "int"
    result: "Standing"

class SidesToCompare(TypedDict):
    """Two sides."""

    a: "DiffSide"
    b: "NotRequired[DiffSide]"

Sigma: TypeAlias = "float | str | list[float | str]"

class Sliding(TypedDict):
    """A given amplitude of the sliding."""

    sliding_amplitude: "Length"
    held: "NotRequired[Literal['amplitude']]"

SlopeAngle: TypeAlias = "float | str"

class SmoothHistories(TypedDict):
    """The histories of a run at more output cycles, in SI. Both are null if the stored points are the best there are."""

    history: "NotRequired[Columns | None]"
    simplified: "NotRequired[Columns | None]"

SoFar: TypeAlias = "RunSoFar | StudySoFar"

Spacing: TypeAlias = "Literal['linear', 'log']"

class SpecificWearRate(TypedDict):
    """The wear coefficient of both bodies together."""

    coefficient: "WearCoefficient | ChangeTable | RunIn"
    share: "NotRequired[Share]"

class Sphere(TypedDict):
    """f = R − √(R²−r²), for contacts that are not small beside the radius; up to a₀/R = 0.6."""

    shape: "Literal['sphere']"
    radius: "Length"

Standing: TypeAlias = "Literal['held', 'dropped', 'unknown']"

class Statistics(TypedDict):
    """Statistics of a study, in columns with one row per output: `output`, `unit`, `points`, `mean`, `standard_deviation`, percentiles such as `percentile_2_5`, and the ends of their intervals, such as `percentile_2_5_low`."""

    engine: "Engine"
    key: "KeyText"
    statistics: "TableColumns"
    units: "Units"

StatisticsAnswer: TypeAlias = "Statistics | Records"

StickRatio: TypeAlias = "float"

Stiffness: TypeAlias = "float | str"

Stress: TypeAlias = "float | str"

Stroke: TypeAlias = "float | str"

class StudyCost(TypedDict):
    """What a study takes."""

    answer_bytes: "int"
    points: "int"
    seconds: "float"

class StudySoFar(TypedDict):
    """The rows of a study that is being computed or was canceled."""

    counts: "dict[str, Any]"
    table: "dict[str, Any]"
    units: "dict[str, Any]"

class StudyTable(TypedDict):
    """The table of a study."""

    engine: "Engine"
    key: "KeyText"
    table: "TableColumns"
    units: "Units"

class SubmissionWarnings(TypedDict):
    """The warnings about a result that it does not contain."""

    warnings: "NotRequired[list[Warning] | None]"

class Sweep(TypedDict):
    """A sweep: the outputs of a scenario for many values of some of its numbers."""

    design: "NotRequired[Design]"
    outputs: "list[OutputName]"
    profiles: "NotRequired[SweepProfiles]"
    samples: "NotRequired[int]"
    scenario: "Scenario"
    seed: "NotRequired[int]"
    vary: "list[Varied]"
    version: "NotRequired[int]"

SweepCurve: TypeAlias = "Literal['wear', 'worn', 'pressure', 'slip']"

class SweepProfiles(TypedDict):
    """Curves of each run after its last output cycle, at radii that all runs share. They are linear between the output radii of the run, whose number is `points` of `model`."""

    fields: "NotRequired[list[SweepCurve]]"
    radius: "Radii"

class SweepResult(TypedDict):
    """The result of a sweep."""

    counts: "Counts"
    engine: "Engine"
    key: "KeyText"
    profiles: "NotRequired[CommonCurves]"
    sweep: "Sweep"
    table: "TableColumns"
    units: "Units"

class Table(TypedDict):
    """A measured profile: heights over radii, evenly spaced or not. The gap is the height less that on the axis. Noise is taken off by local parabolas whose reach the points themselves decide (exact points are left as they are), and the points are joined by a monotone cubic; more than 500 points are first averaged in groups of neighbours. The table must go on beyond the scar to come, and the profile's image must rise as far. For a line contact, the radii are distances from the middle, and `length` is required."""

    shape: "Literal['table']"
    radius: "list[Radius]"
    height: "list[Height]"
    geometry: "NotRequired[Geometry]"
    length: "NotRequired[Length]"

TableAnswer: TypeAlias = "StudyTable | Records"

TableColumns: TypeAlias = "dict[str, list[Cell]]"

TableFields: TypeAlias = "list[str]"

TableFormat: TypeAlias = "Literal['json', 'ndjson', 'csv', 'npz', 'arrow']"

Tag: TypeAlias = "str"

TangentialForce: TypeAlias = "float | str"

class Times(TypedDict):
    """When a job was submitted, begun and finished: RFC 3339, UTC."""

    created: "str"
    finished: "NotRequired[str | None]"
    started: "NotRequired[str | None]"

Tolerance: TypeAlias = "float"

class TriangularDistribution(TypedDict):
    high: "NumberOrText"
    low: "NumberOrText"
    mode: "NumberOrText"

class TruncatedCone(TypedDict):
    """f = (r−b)·tan θ for r > b, flat inside. Stick ratios as for the truncated paraboloid."""

    shape: "Literal['truncated_cone']"
    slope_angle: "SlopeAngle"
    flat_radius: "Length"

class TruncatedParaboloid(TypedDict):
    """f = (r²−b²)/(2R) for r > b, flat inside: a ball worn or cut at its tip. The springs under the flat slip all together, so that a stick ratio is either 0, which means that just the flat sticks, or at least b/a₀."""

    shape: "Literal['truncated_paraboloid']"
    radius: "Length"
    flat_radius: "Length"

class UniformDistribution(TypedDict):
    high: "NumberOrText"
    low: "NumberOrText"

UnitSystem: TypeAlias = "Literal['si', 'engineering']"

Units: TypeAlias = "dict[str, str]"

Until: TypeAlias = "UntilDepth | UntilVolume | UntilEnergy"

class UntilDepth(TypedDict):
    """A largest depth."""

    wear_depth: "Length"

class UntilEnergy(TypedDict):
    """A dissipated energy."""

    dissipated_energy: "DissipatedEnergy"

class UntilVolume(TypedDict):
    """A wear volume."""

    wear_volume: "Volume"

class Unworn(TypedDict):
    """The state before the first cycle."""

    actuator_amplitude: "NotRequired[float]"
    actuator_energy_ratio: "NotRequired[float]"
    actuator_gross_slip_amplitude: "NotRequired[float]"
    actuator_slip_ratio: "NotRequired[float]"
    amplitude: "float | None"
    energy_per_cycle: "float"
    energy_ratio: "float | None"
    free_ratio: "float"
    gross_slip_amplitude: "float | None"
    mean_pressure: "float"
    normal_modulus: "float"
    peak_pressure: "float | None"
    slip_ratio: "float | None"
    stick_radius: "float"
    tangential_force: "float"
    tangential_modulus: "float | None"
    wear_coefficient: "float"

Up: TypeAlias = "Literal['out', 'in']"

Varied = TypedDict(
    "Varied",
    {
        "count": "NotRequired[int]",
        "distribution": "NotRequired[Distribution]",
        "from": "NotRequired[NumberOrText]",
        "pointer": "str",
        "spacing": "NotRequired[Spacing]",
        "to": "NotRequired[NumberOrText]",
        "values": "NotRequired[list[NumberOrText]]",
    },
)

class VerdictAnswer(TypedDict):
    """Whether the law of a fit describes its data."""

    intervals: "NotRequired[str | None]"
    outcome: "str"
    reason: "str"
    verdict: "str"

class Version(TypedDict):
    """The program, the version of its numbers, and its limits."""

    limits: "Limits"
    name: "str"
    numerics: "int"
    version: "str"

Volume: TypeAlias = "float | str"

class Warning(TypedDict):
    """A warning about a scenario. It does not prevent a run."""

    detail: "str"
    kind: "str"

Wear: TypeAlias = "SpecificWearRate | Archard | EnergyWearCoefficient | BodiesAndLayers"

WearCoefficient: TypeAlias = "float | str"

class WearProfile(TypedDict):
    """The measured depth of a scar."""

    at: "float"
    body: "NotRequired[int]"
    depth: "list[MeasuredCell]"
    noise: "NotRequired[Noise]"
    profile: "MeasuredProfile"
    radius: "list[NumberOrText]"
    relative: "NotRequired[float]"
    sigma: "NotRequired[Sigma]"

WearRate: TypeAlias = "WearCoefficient | float"

class Wedge(TypedDict):
    """A line contact: f = |x|·tan θ."""

    shape: "Literal['wedge']"
    slope_angle: "SlopeAngle"
    length: "Length"

WholeFormat: TypeAlias = "Literal['json', 'npz']"

WholeLayout: TypeAlias = "Literal['columns']"

class WornBody(TypedDict):
    """How one body wears: its layers, and the material below them."""

    coefficient: "WearRate"
    layers: "NotRequired[list[Layer]]"

Xi: TypeAlias = "float"
