"""Which slow, obvious twin each kernel has; `tests/promises/test_kernels_have_twins.py` checks that none is missing.

A kernel needs a twin when uncompiled code calls it, or kernels of another folder do. What is called by kernels of its
own folder alone is part of those.
"""

TWINS = {
    "baselines.crw.step_crw": "controllers.ReferenceRobot",
    "baselines.dpo.step_dpo": "controllers.ReferenceRobot",
    "baselines.memory.density": "controllers.ObjectDictionary",
    "baselines.stoch_n1.partition_probability": "task_chain.partition",
    "baselines.task_machines.step_tasks": "task_controllers.ReferenceTaskRobot",
    "swarm_forage_env.contract.detection.is_obstacle_vector": "controllers.ReferenceRobot",
    "swarm_forage_env.contract.detection.ring_sum": "compact_view.compact_row",
    "swarm_forage_env.contract.detection.sees_cache": "compact_view.compact_row",
    "swarm_forage_env.contract.detection.sees_nest": "compact_view.compact_row",
    "swarm_forage_env.contract.detection.sees_object": "controllers.ReferenceRobot",
    "swarm_forage_env.contract.detection.sees_obstacle": "controllers.ReferenceRobot",
    "swarm_forage_env.policies.kernels.commands.automatic_grip": "commands.automatic_grip",
    "swarm_forage_env.policies.kernels.commands.mask_actions": "commands.allowed_actions",
    "swarm_forage_env.policies.kernels.commands.numbered_actions": "commands.numbered_action",
    "swarm_forage_env.policies.kernels.compact.compact_view": "compact_view.compact_row",
    "swarm_forage_env.world.kernels.beams.proximity": "sensing.proximity",
    "swarm_forage_env.world.kernels.drive.drive": "motion.free_motion",
    "swarm_forage_env.world.kernels.drive.limit_command": "motion.limited_wheels",
    "swarm_forage_env.world.kernels.drive.unpack_poses": "motion.free_motion",
    "swarm_forage_env.world.kernels.floor.ground": "sensing.ground",
    "swarm_forage_env.world.kernels.floor.light": "sensing.light",
    "swarm_forage_env.world.kernels.floor.line_of_sight": "sensing.objects_in_sight",
    "swarm_forage_env.world.kernels.interact.clear_events": "interacting.SlowWorld",
    "swarm_forage_env.world.kernels.interact.interact": "interacting.SlowWorld",
    "swarm_forage_env.world.kernels.interfere.mark": "sensing.proximity",
    "swarm_forage_env.world.kernels.neighbours.bin_robots": "sensing.proximity",
    "swarm_forage_env.world.kernels.proprioception.own_motion": "sensing.observe",
    "swarm_forage_env.world.kernels.proprioception.own_status": "sensing.observe",
    "swarm_forage_env.world.kernels.scatter.scatter": "object_placement.scatter_slowly",
    "swarm_forage_env.world.kernels.walk.walk": "object_walk.walk_slowly",
    "swarm_forage_env.wrappers.kernels.noise.perturb_readings": "adversity.noisy_row",
    "swarm_forage_env.wrappers.kernels.noise.turn_heading": "adversity.noisy_row",
    "swarm_forage_env.wrappers.kernels.task_shares.add_task_shares": "task_shares.task_shares",
    "swarm_forage_env.wrappers.kernels.throttle.throttle": "adversity.throttle_gain",
}
"""Kernel -> its twin, a name in a module of `tests.reference`."""

WITHOUT = {
    "swarm_forage_env.world.kernels.interact.drop_cargo": "two rules of `interact`, which has a twin; by hand in "
    "tests/world/test_interactions_timing.py",
    "swarm_forage_env.wrappers.kernels.gaussian.to_normal": "compared with the normal distribution function of scipy",
    "swarm_forage_env.wrappers.kernels.noise.noisy_gain": "one product per wheel; by hand in "
    "tests/wrappers/test_noise.py",
}
"""Kernel -> why it has no twin here."""
