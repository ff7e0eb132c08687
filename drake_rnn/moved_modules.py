"""Modules under their names of version 0.3, which work for one release, with a warning."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

#: New names, and the old ones whose contents they hold; all within `drake_rnn`.
PLACES = """
arrays.algebra: arrays.namespace arrays.series arrays.substeps arrays.pivoting arrays.jax_module
batch.compiled_runs: batch.compiling batch.slopes batch.compiled_step
batch.grouping: batch.filtering batch.why_not
batch.robots: batch.snapshot
batch.run: batch.block
batch.signals: batch.desired batch.noise batch.pressing batch.schedule
claims.claims: claims.claim claims.reading claims.schema claims.measuring claims.judging
    claims.run_source
cli.arguments: cli.asked cli.asked.running cli.asked.looking_up cli.asked.results cli.asked.robots
    cli.asked.claims
cli.campaigning: cli.campaign_shown cli.sweeping
cli.catalogue: cli.describing cli.showing cli.new cli.shipping cli.schemas cli.graphs
cli.command: cli.options cli.completing cli.usage
cli.comparing: cli.tuning
cli.driving: cli.live
cli.presenting: cli.again cli.exporting cli.filming cli.printing cli.claims cli.report
cli.running: cli.queue cli.announcing cli.simulating
cli.saving: cli.changing cli.drawing cli.printed
cli.starting: cli.streams cli.interrupting cli.statuses
cli.tables: cli.written_tables
diagrams.loop: diagrams.checks
drive.approach: drive.planned_approach drive.ramp_down drive.driven_law drive.robot_task
drive.cycles: drive.watches drive.log
drive.driving: drive.connecting drive.paced
drive.iiwa_lcm: drive.simulated_iiwa drive.faults drive.following_robot
drive.robots: drive.connection drive.settings
drive.session: drive.listening
drive.shared_cycles: drive.priority
environments: environments.surface environments.elastic_surface environments.contact_model
    environments.plate environments.model_surface environments.solids
experiment.components: experiment.arms experiment.path experiment.law
experiment.experiment: experiment.expected_bounds experiment.judged experiment.reach
experiment.files: experiment.changes experiment.heads experiment.fingerprint
experiment.keys: experiment.schema
experiment.sections: experiment.targets experiment.target experiment.whole
exports: exports.export exports.recording exports.stamps exports.tables exports.trajectory
features.camera: playback.cameras robot.pinhole
features.contact: systems.contact systems.contact_reference systems.force_sensor systems.force_watch
    systems.normal_force experiment.contact experiment.pressed
features.feature: diagrams.wiring experiment.guarantees
features.locks: playback.locked_joints
features.obstacles: systems.obstacle_source experiment.moving playback.obstacles
    playback.arm_capsules experiment.safety
features.second: playback.second_arm experiment.second systems.led_source systems.neighbour_source
features.sensing: systems.sensors systems.joint_sensor systems.pose_sensor systems.sensing_settings
    systems.lateness systems.white_noise
figures.campaign: figures.campaign_page figures.sweep figures.tuning
figures.comparison: figures.compared
figures.force_panels: figures.pressing figures.image_panels figures.jacobian_panels
figures.joint_panels: figures.bound_lines figures.derivative_panels figures.derivatives
figures.overview: figures.limit_panel figures.space
figures.registry: figures.traits
figures.result_figures: figures.single figures.drawn
figures.style: figures.looks figures.paper figures.labels figures.grid
figures.task_panels: figures.transients figures.ends figures.surface
film.encoding: film.numbers film.fitting film.timing film.settings film.caption film.browser
    film.player
inputs.documents: inputs.extensions inputs.names
inputs.fields: inputs.arguments
inputs.files: inputs.given_file inputs.csv_rows inputs.page_templates robot.model.cache
inputs.keys: inputs.json_schema
inputs.kinds: inputs.modules inputs.offers inputs.own_code
inputs.messages: inputs.complaints inputs.dataclass_fields inputs.numbers
inputs.packages: inputs.lending inputs.extras inputs.versions inputs.html robot.model.late_import
inputs.processes: inputs.lifeline inputs.signals_held
jobs: campaigns
jobs.campaign: campaigns.perform campaigns.side_by_side batch.in_reach campaigns.campaign
    campaigns.sweep
jobs.plan: campaigns.document campaigns.schema campaigns.plan jobs.variation campaigns.variation
jobs.pool: campaigns.workers campaigns.cluster campaigns.engine campaigns.tasks
jobs.requests: campaigns.outcome campaigns.store
jobs.summary: campaigns.summary campaigns.statistics campaigns.table
laws.call_checks: laws.called
laws.checks: laws.trial laws.stacked
laws.guard: laws.joint_stream
laws.joint_drift_free: laws.parts.two_step
laws.law: laws.layout
laws.parts.bounded_velocity: laws.parts.held_within laws.parts.reached_limits laws.parts.kept_limits
laws.parts.jacobian: laws.parts.learned_jacobian laws.parts.known_jacobian laws.parts.learning
    laws.parts.measurement laws.parts.late laws.parts.signal_rates
laws.parts.path_task: laws.parts.approach laws.parts.pixels laws.parts.braking
laws.parts.programs: laws.parts.box_program laws.parts.rows_program laws.program.quadratic_program
    laws.parts.primal_dual laws.parts.bounded_multipliers laws.parts.stable_steps
laws.parts.reach_edge: laws.parts.near_singular
laws.parts.safe_velocity: laws.parts.held_clear
laws.parts.secondary: laws.parts.led_away
laws.parts.surface_task: laws.parts.contact_loss laws.parts.force_control laws.parts.stiffness
laws.parts.world: laws.parts.certificate
laws.projection: laws.networks.projected_program laws.networks.projected_step
    laws.networks.sampled_projection
laws.pseudoinverse: laws.parts.damped_inverse
laws.receding_horizon: laws.parts.horizon_program laws.parts.quintic_spline
laws.scheme: laws.program.scheme laws.program.rows laws.program.costs laws.program.bounds
    laws.program_law laws.learning_program_law laws.program_reading
laws.simultaneous_learning: laws.parts.warm_up
laws.state_adjustment: laws.null_space_adjustment laws.posture_law laws.parts.held_joints
    laws.parts.rise
laws.zeroing: laws.networks.zeroing_network laws.networks.optimality laws.networks.barriers
    laws.networks.funnel
laws.zeroing_design: laws.networks.design laws.networks.activations laws.networks.growth
    laws.networks.discretization laws.parts.network_noise
live.controls: live.gains live.variants
live.hands: live.handled_force live.handled_path live.course live.shaping
live.play: live.pace live.page live.scene
live.segment: live.carried live.gauge
live.serving: live.lease live.requests
live.session: live.recording
measures.metric: measures.gathering measures.units measures.values measures.yardsticks
measures.metric_groups: measures.groups measures.groups.group measures.groups.bounds
    measures.groups.drift measures.groups.following measures.groups.gap measures.groups.higher
    measures.groups.network measures.groups.rest
measures.motion: measures.image_motion measures.ticks
measures.run_metrics: measures.recorder
paths.curve: paths.timing paths.rest paths.line
paths.drawing: paths.run paths.strokes paths.text
paths.joint_targets: paths.target_path
paths.path: paths.checks paths.relative paths.led
paths.pieces: paths.arc_length
paths.planar: paths.in_plane paths.cone paths.trigonometric paths.polygons paths.cat
paths.points: paths.table paths.waypoints
paths.sequence: paths.bridge
paths.svg: paths.svg_document
paths.trajectory: paths.timed paths.turning
playback.arm_drawing: playback.drawn_arm playback.maker_looks figures.arm_picture
playback.chart: playback.shown_curves playback.joints playback.accepted
playback.page: playback.stage playback.outcome playback.template playback.recorded
playback.path_drawings: playback.drawn_paths playback.curves playback.axes playback.paths_in_air
    playback.paths_beside playback.surface_drawing playback.paths_on_surface playback.force_arrow
playback.replay: playback.surface playback.packing playback.animation playback.lines
playback.viewpoint: playback.camera playback.boxes playback.views
report.kept_runs: report.gathering report.pictures
report.report: report.origin report.markdown report.pages report.contents
robot.arm: robot.held_joints
robot.arm_description: robot.tool_description robot.link_error_settings robot.looks_file
robot.clearance.arm_clearance: robot.clearance.own_pairs robot.clearance.least_distance
robot.clearance.arm_shapes: robot.clearance.enclosing_capsule
robot.clearance.capsules: robot.clearance.link_poses robot.clearance.segments robot.clearance.solids
robot.clearance.clearance: robot.clearance.pairs robot.clearance.beside robot.clearance.neighbour
robot.clearance.model_obstacle: robot.clearance.enclosing_box robot.clearance.described_obstacles
robot.jerk_stop: robot.held_jerk_stop robot.held_stop
robot.joint_stop: robot.stop_step robot.joint_envelope
robot.kinematics: robot.structure
robot.limits: robot.resting
robot.load_arm: robot.arm_screws robot.report
robot.model.formats: robot.model.urdf robot.model.possible_inertia robot.model.sdf robot.model.mimic
robot.model.meshes: robot.model.conversion robot.model.simplified robot.model.geometry
    robot.model.materials
robot.model.model: robot.drake_log robot.contact_mesh robot.model.displaced robot.model.still
robot.model.ros_packages: robot.model.packages robot.model.xml_text robot.model.expansion
robot.postures: robot.inertia robot.self_motion
robot.screws: robot.moved_screws robot.triples robot.link_errors
robot.velocity_envelope: robot.jerk_box
runs.checkpoint: runs.keeper
runs.evaluation: runs.caveats runs.motion
runs.folder: runs.whole_file runs.saved
runs.limit_use: runs.conclusion runs.derivatives runs.fastest
runs.result: runs.verdict runs.told_metrics
runs.series: runs.stored runs.columns runs.beside
runs.simulation: runs.effort
systems.body: systems.ideal_arm systems.robot_arm systems.spring_contact systems.kinematics
    systems.dynamics
systems.controllers: systems.tunable_controller systems.leading_controller
systems.plant: systems.plant_settings systems.motor_gains
systems.plant_arm: systems.contact_force systems.tool_force
systems.sources: systems.path_source systems.joint_reference systems.target_source
tables: tables.sheet tables.markdown tables.latex tables.written
tuning: tuning.tuned tuning.choosing tuning.descent tuning.bounds
"""
#: Names within these modules that have changed, by their old names.
NEW_NAMES = {
    "Order": "RunRequest",
    "Outcome": "RunRecord",
    "RowStore": "RecordStore",
    "order_of": "request_of",
    "unique_orders": "unique_requests",
}


class MovedModules(MetaPathFinder):
    """Finds a module under its old name, after Python has found none of that name."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """See `MetaPathFinder.find_spec`."""
        package, _, old = fullname.partition(".")
        new = _NEW.get(old) if package == __package__ else None
        if new is None:
            # A folder of modules that have moved.
            is_folder = package == __package__ and any(each.startswith(f"{old}.") for each in _NEW)
            return ModuleSpec(fullname, None, is_package=True) if is_folder else None
        warnings.warn(
            f"{fullname} is now {package}.{new}; its old name works until the next release",
            DeprecationWarning,
            stacklevel=2,
        )
        return ModuleSpec(fullname, _AliasLoader(f"{package}.{new}"), is_package=True)


class _AliasLoader(Loader):
    """Makes a module with all names of another one."""

    def __init__(self, new: str) -> None:
        self._new = new

    def exec_module(self, module: ModuleType) -> None:
        names = dict(vars(import_module(self._new)))
        if "__getattr__" in names:
            names |= {name: names["__getattr__"](name) for name in names["__all__"]}
        names |= {old: names[new] for old, new in NEW_NAMES.items() if new in names}
        vars(module).update({name: names[name] for name in names if not name.startswith("__")})


def _new_names() -> dict[str, str]:
    rows = PLACES.replace("\n    ", " ").splitlines()
    pairs = (row.partition(":") for row in rows if row)
    return {old: new for new, _, names in pairs for old in names.split()}


_NEW = _new_names()
