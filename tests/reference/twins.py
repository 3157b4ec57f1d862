"""Which slow, obvious twin stands beside each kernel, and where the two are compared.

A kernel needs a twin when uncompiled code calls it, or kernels of another folder do. What is called by kernels of its
own folder alone is part of those. `tests/promises/test_kernels_have_twins.py` holds the table complete and true.
"""

from typing import NamedTuple


class Twin(NamedTuple):
    """Where a kernel is compared with what."""

    name: str
    """The twin, a name in a module of `tests.reference`; the test calls it."""
    test: str
    """File below `tests/` that compares the two."""
    caller: str
    """What the test calls: the kernel itself, or a function that leads to it."""


CRW = Twin("controllers.ReferenceRobot", "baselines/test_controller_twins.py", "baselines.crw.CRWPolicy.reset")
TASKS = Twin(
    "task_controllers.ReferenceTaskRobot", "baselines/test_task_twins.py", "baselines.task_policy.TaskPolicy.reset"
)
COMPACT_VIEW = Twin(
    "compact_view.compact_row",
    "policies/test_interface.py",
    "swarm_forage_env.policies.interface.LearnerInterface.observe",
)
SITES = Twin(
    "site_memory.RobotSites",
    "policies/test_site_memory.py",
    "swarm_forage_env.policies.interface.LearnerInterface.observe",
)
SEEN_IN_FRAMES = Twin(
    "frames.seen", "policies/test_frames.py", "swarm_forage_env.policies.interface.LearnerInterface.observe"
)
DONE_IN_FRAMES = Twin(
    "frames.commands", "policies/test_frames.py", "swarm_forage_env.policies.interface.LearnerInterface.command"
)
PERCEPTRON = Twin("perceptron.outputs", "policies/test_network.py", "swarm_forage_env.policies.network.Network.outputs")
INTERFERENCE = Twin("sensing.interferes", "world/test_interference.py", "swarm_forage_env.env.ForageEnv.step_batch")
OBSERVED = Twin("sensing.observe", "world/test_sensors.py", "swarm_forage_env.world.arena.ForagingArena.observe")
MOTION = Twin("motion.free_motion", "world/test_physics.py", "swarm_forage_env.env.ForageEnv.step_batch")
INTERACTIONS = Twin(
    "interacting.SlowWorld", "world/test_interactions_twin.py", "swarm_forage_env.world.kernels.interact.serve"
)
NEIGHBOURS = Twin(
    "neighbourhood.neighbours", "world/test_neighbourhood.py", "swarm_forage_env.env.ForageEnv.step_batch"
)
MESSAGES = Twin("neighbourhood.heard", "world/test_neighbourhood.py", "swarm_forage_env.env.ForageEnv.step_batch")
KINDS = Twin("kinds.observe", "world/test_kinds.py", "swarm_forage_env.env.ForageEnv.step_batch")
NOISE = Twin("adversity.noisy_row", "wrappers/test_noise.py", "swarm_forage_env.wrappers.noise.SensorNoise.observe")

TWINS = {
    "baselines.cpfa.step_cpfa": Twin("cpfa.CPFARobot", "baselines/test_cpfa.py", "baselines.cpfa.CPFAPolicy.reset"),
    "baselines.crw.step_crw": CRW,
    "baselines.dpo.step_dpo": Twin(
        "controllers.ReferenceRobot", "baselines/test_controller_twins.py", "baselines.dpo.DPOPolicy.reset"
    ),
    "baselines.memory.density": Twin(
        "controllers.ObjectDictionary", "baselines/test_memory.py", "baselines.dpo.DPOPolicy.remembered"
    ),
    "baselines.stoch_n1.partition_probability": TASKS,
    "baselines.task_machines.step_tasks": TASKS,
    "swarm_forage_env.contract.detection.is_obstacle_vector": CRW,
    "swarm_forage_env.contract.detection.ring_is_empty": CRW,
    "swarm_forage_env.contract.detection.ring_sum": COMPACT_VIEW,
    "swarm_forage_env.contract.detection.sees_cache": COMPACT_VIEW,
    "swarm_forage_env.contract.detection.sees_nest": COMPACT_VIEW,
    "swarm_forage_env.contract.detection.sees_object": CRW,
    "swarm_forage_env.contract.detection.sees_obstacle": INTERFERENCE,
    "swarm_forage_env.policies.kernels.frames.frame_of": Twin(
        "frames.frame", "policies/test_frames.py", "swarm_forage_env.policies.kernels.frames.frame_of"
    ),
    "swarm_forage_env.policies.kernels.frames.take_frames": SEEN_IN_FRAMES,
    "swarm_forage_env.policies.kernels.frames.leave_frames": DONE_IN_FRAMES,
    "swarm_forage_env.policies.kernels.learner.automatic_grip": Twin(
        "commands.automatic_grip",
        "policies/test_interface_twins.py",
        "swarm_forage_env.policies.interface.LearnerInterface.command",
    ),
    "swarm_forage_env.policies.kernels.learner.mask_actions": Twin(
        "commands.allowed_actions",
        "policies/test_interface_twins.py",
        "swarm_forage_env.policies.interface.LearnerInterface.mask",
    ),
    "swarm_forage_env.policies.kernels.learner.numbered_actions": Twin(
        "commands.numbered_action",
        "policies/test_interface_twins.py",
        "swarm_forage_env.policies.interface.LearnerInterface.command",
    ),
    "swarm_forage_env.policies.kernels.learner.compact_view": COMPACT_VIEW,
    "swarm_forage_env.policies.kernels.learner.remember_sites": SITES,
    "swarm_forage_env.policies.kernels.learner.show_sites": SITES,
    "swarm_forage_env.policies.kernels.network.forward": PERCEPTRON,
    "swarm_forage_env.policies.kernels.network.step_network": Twin(
        "perceptron.SlowNetwork",
        "policies/test_network_twin.py",
        "swarm_forage_env.policies.network.NetworkPolicy.reset",
    ),
    "swarm_forage_env.rendering.kernels.paint_round": Twin(
        "painting.round_share", "rendering/test_paint.py", "swarm_forage_env.rendering.paint.paint_discs"
    ),
    "swarm_forage_env.rendering.kernels.paint_square": Twin(
        "painting.square_share", "rendering/test_paint.py", "swarm_forage_env.rendering.paint.paint_squares"
    ),
    "swarm_forage_env.world.kernels.beams.proximity": OBSERVED,
    "swarm_forage_env.world.kernels.bodies.move_bodies": Twin(
        "bodies.moved", "world/test_bodies.py", "swarm_forage_env.world.kernels.bodies.move_bodies"
    ),
    "swarm_forage_env.world.kernels.contact.press": Twin(
        "contact.pressed_velocities", "world/test_contact.py", "swarm_forage_env.world.kernels.contact.press"
    ),
    "swarm_forage_env.world.kernels.drive.drive": MOTION,
    "swarm_forage_env.world.kernels.drive.hold_inside": Twin(
        "motion.held_inside", "world/test_physics.py", "swarm_forage_env.world.kernels.drive.hold_inside"
    ),
    "swarm_forage_env.world.kernels.drive.unpack_poses": MOTION,
    "swarm_forage_env.world.kernels.floor.ground": OBSERVED,
    "swarm_forage_env.world.kernels.floor.light": OBSERVED,
    "swarm_forage_env.world.kernels.floor.line_of_sight": OBSERVED,
    "swarm_forage_env.world.kernels.interact.serve": INTERACTIONS,
    "swarm_forage_env.world.kernels.counting.mark": INTERFERENCE,
    "swarm_forage_env.world.kernels.kinds.blank": KINDS,
    "swarm_forage_env.world.kernels.kinds.tell_kinds": KINDS,
    "swarm_forage_env.world.kernels.neighbourhood.hear": MESSAGES,
    "swarm_forage_env.world.kernels.neighbourhood.say": MESSAGES,
    "swarm_forage_env.world.kernels.neighbourhood.see_neighbours": NEIGHBOURS,
    "swarm_forage_env.world.kernels.neighbourhood.bin_robots": OBSERVED,
    "swarm_forage_env.world.kernels.obstacles.hold_outside": Twin(
        "bodies.held_outside", "world/test_obstacles.py", "swarm_forage_env.world.kernels.obstacles.hold_outside"
    ),
    "swarm_forage_env.world.kernels.proprioception.own_motion": OBSERVED,
    "swarm_forage_env.world.kernels.proprioception.own_status": OBSERVED,
    "swarm_forage_env.world.kernels.placement.scatter": Twin(
        "object_placement.scatter_slowly", "world/test_placement.py", "swarm_forage_env.world.kernels.placement.scatter"
    ),
    "swarm_forage_env.world.kernels.walk.walk": Twin(
        "object_walk.walk_slowly", "world/test_object_motion.py", "swarm_forage_env.world.kernels.walk.walk"
    ),
    "swarm_forage_env.world.kernels.disturbances.disturb": NOISE,
    "swarm_forage_env.world.kernels.disturbances.draw_bits": Twin(
        "adversity.noise_bits", "wrappers/test_noise.py", "swarm_forage_env.world.kernels.disturbances.draw_bits"
    ),
    "swarm_forage_env.world.kernels.counting.add_task_shares": Twin(
        "task_shares.task_shares",
        "wrappers/test_recorder.py",
        "swarm_forage_env.world.kernels.counting.add_task_shares",
    ),
    "swarm_forage_env.world.kernels.disturbances.throttle": Twin(
        "adversity.throttle_gain", "wrappers/test_throttle.py", "swarm_forage_env.wrappers.base.SwarmWrapper.step_batch"
    ),
}
"""Kernel -> its twin."""

IN_ORDER = "only calls others, each with its twin; whole runs are in tests/promises/test_golden_runs.py"

ONE_BY_ONE = "compared with arenas that are taken one by one in tests/world/test_lockstep.py"

WITHOUT = {
    "swarm_forage_env._internal.pcg64.write_uniform": "compared with numpy itself in tests/internal/test_rng.py",
    "swarm_forage_env._internal.held.keep": "a copy; read again in tests/internal/test_held.py",
    "swarm_forage_env.world.kernels.reward.book_rows": "sums row by row; the lives of rows are told by hand in "
    "tests/views/test_arenas.py",
    "swarm_forage_env.rendering.kernels.paint_share": "one product per colour; by hand in "
    "tests/rendering/test_paint.py",
    "swarm_forage_env.rendering.kernels.take_picture": "compared with `numpy.rint` in tests/rendering/test_paint.py",
    "swarm_forage_env.world.kernels.neighbourhood.mark_cells": "what is seen with and without it is compared in "
    "tests/world/test_marked_cells.py",
    "swarm_forage_env.world.kernels.bodies.tell_poses": "compared with `unpack_poses` in tests/world/test_bodies.py",
    "swarm_forage_env.world.kernels.interact.drop_cargo": "two rules of `interact`, which has a twin; by hand in "
    "tests/world/test_interactions_timing.py",
    "swarm_forage_env.world.kernels.lockstep.book_each": "`book_rows` for each world, and a copy; " + ONE_BY_ONE,
    "swarm_forage_env.world.kernels.lockstep.pay_each": "`rewards` for each world; " + ONE_BY_ONE,
    "swarm_forage_env.world.kernels.lockstep.whole_each": "`tick.whole` for each world; compared with arenas that are "
    "stepped alone in tests/world/test_lockstep.py",
    "swarm_forage_env.world.kernels.placement.place_displaced": "`scatter`, and what follows from it; compared with "
    "`place_objects` in tests/world/test_placement.py",
    "swarm_forage_env.policies.kernels.network.keep_on": "hands `state` to `carry_out`, which has a twin; "
    + ONE_BY_ONE,
    "swarm_forage_env.world.kernels.reward.pay": "`rewards`, and a sum; " + ONE_BY_ONE,
    "swarm_forage_env.world.kernels.reward.remember": "a copy; rewards for progress are compared with arenas that are "
    "taken one by one in tests/world/test_lockstep.py",
    "swarm_forage_env.world.kernels.reward.rewards": "a weighted sum; term by term in tests/world/test_rewards.py",
    "swarm_forage_env.world.kernels.tick.close": IN_ORDER,
    "swarm_forage_env.world.kernels.tick.decide": "the loop of `LearnerArena.step`; " + ONE_BY_ONE,
    "swarm_forage_env.world.kernels.tick.meet_and_close": IN_ORDER,
    "swarm_forage_env.world.kernels.tick.observe": IN_ORDER,
    "swarm_forage_env.world.kernels.tick.run": "the loop of `LiveRun`; both are compared in "
    "tests/runs/test_compiled_runs.py",
    "swarm_forage_env.world.kernels.tick.set_out": IN_ORDER,
    "swarm_forage_env.world.kernels.tick.whole": IN_ORDER,
    "swarm_forage_env.world.kernels.disturbances.disturb_wheels": "`throttle` and `noisy_gain`; compared with "
    "hooks in tests/runs/test_compiled_disturbances.py",
    "swarm_forage_env.world.kernels.disturbances.noisy_gain": "one product per wheel; by hand in "
    "tests/wrappers/test_noise.py",
}
"""Kernel -> why it has no twin here."""
