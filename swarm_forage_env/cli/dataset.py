"""The command `dataset`."""

from pathlib import Path
from typing import Annotated

import typer

from swarm_forage_env.cli.option_groups import PolicyOptions, WorldOptions
from swarm_forage_env.cli.options import DryRun, FirstSeed, complain
from swarm_forage_env.cli.signals import EXIT_INTERRUPTED


def dataset(  # long: one parameter per option
    policies: PolicyOptions,
    described: WorldOptions,
    seeds: Annotated[int, typer.Option(min=1, help="Number of runs.")] = 1,
    first_seed: FirstSeed = 0,
    observation: Annotated[
        str | None,
        typer.Option(help="full or compact; default what a learned policy sees, else full."),
    ] = None,
    site_memory: Annotated[
        bool | None,
        typer.Option(
            "--site-memory/--no-site-memory",
            help="Whether to record two places that robots remember; default as a learned policy sees, else not.",
        ),
    ] = None,
    compress: Annotated[bool, typer.Option("--compress", help="Smaller files, which take longer to write.")] = False,
    minari: Annotated[
        str | None, typer.Option(metavar="ID", help="Also make a Minari data set of the whole swarm as one agent.")
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", help="Folder; default results/datasets/SCENARIO_POLICY.")] = None,
    dry_run: DryRun = False,
) -> None:
    """Record what robots see and do, for offline reinforcement learning and imitation.

    Writes observations, actions, rewards and ends of every robot. Runs that the folder holds already are not repeated,
    so an interrupted command can simply be given again.
    """
    from swarm_forage_env._internal.files import as_file_name
    from swarm_forage_env.cli.scenario_options import plan_runs
    from swarm_forage_env.cli.terminal import progress_bar
    from swarm_forage_env.policies.registry import policy_label
    from swarm_forage_env.training.datasets.recording import plan_dataset, record_dataset

    spec = plan_runs(described, (policies.one("dpo"),), n_seeds=1, first_seed=first_seed)[0]
    plan = plan_dataset(
        spec,
        range(first_seed, first_seed + seeds),
        observation=observation,
        site_memory=site_memory,
        compress=compress,
    )
    folder = out or Path("results", "datasets", as_file_name(f"{spec.scenario.name}_{policy_label(spec.policy)}"))
    typer.echo(plan.describe(folder).text())
    if dry_run:
        return
    if minari is not None:
        from swarm_forage_env.training.datasets.minari_export import check_minari

        check_minari(minari)  # before hours of work
    try:
        with progress_bar("decisions") as progress:
            runs = record_dataset(plan, folder, progress=progress)
    except KeyboardInterrupt:
        words = f"Interrupted. Finished runs are kept in {folder}; the same command does the rest."
        raise typer.Exit(complain(words, EXIT_INTERRUPTED)) from None
    delivered = sum(run.collected for run in runs)
    typer.echo(f"wrote {folder}: {sum(sum(run.chunks) for run in runs):,} decisions, {delivered:,} objects delivered")
    if minari is not None:
        from swarm_forage_env.training.datasets.minari_export import export_minari

        typer.echo(f"wrote the Minari data set {export_minari(folder, minari).spec.dataset_id}")
