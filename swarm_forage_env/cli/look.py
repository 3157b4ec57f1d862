"""The commands that show what is there, or one run: `list`, `info`, `play`, `record`, `replay`, `maps`."""

import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from swarm_forage_env.cli.options import AsJson, Picture, Policies, Policy, Seed, Seeds, WorldOptions
from swarm_forage_env.cli.printer import note, say, show

if TYPE_CHECKING:
    from swarm_forage_env.inspect.replay.frames import Replay

PAGES = (".html", ".htm")
"""Endings of a page that browsers open."""


def list_everything(what: str | None = None, /, *, as_json: AsJson = False) -> None:
    """List scenarios and policies, wrappers, or the columns of run records.

    Args:
        what: scenarios, policies, wrappers or columns (of records).
    """
    from swarm_forage_env.inspect.descriptions import overview

    show(overview(what), as_json=as_json)


def info(name: str, /, *, as_json: AsJson = False) -> None:
    """Describe a scenario, with all its fields and spaces, or a policy.

    Args:
        name: A scenario, an environment id, a policy or its file.
    """
    from swarm_forage_env.inspect.descriptions import describe

    show(describe(name), as_json=as_json)


def play(
    policy: Policy = "crw",
    /,
    *,
    world: WorldOptions = WorldOptions(),
    seed: Seed = 0,
    port: int = 0,
    browser: Annotated[bool, Parameter(negative="--no-browser")] = True,
) -> None:
    """Steer a run in the browser: move sliders, draw walls, kill robots.

    The page is on this machine only. It needs no further packages. Ctrl-C ends it.

    Args:
        port: Port of the page on this machine; 0 = any that is free.
        browser: Open the page in the browser.
    """
    from swarm_forage_env.cli.worlds import described_world
    from swarm_forage_env.inspect.play.server import PlayServer
    from swarm_forage_env.inspect.play.session import PlaySession, Setting

    chosen, caches = described_world(world)
    session = PlaySession(Setting(world=chosen, policy=policy, seed=seed, caches=caches))
    try:
        server = PlayServer(session, port)
    except OSError as error:
        raise OSError(f"{error.strerror or error}: port {port}; leave out --port to get one that is free.") from error
    say(f"play at {server.address}")
    note("Ctrl-C ends it.")
    if browser:
        webbrowser.open(server.address)
    try:
        server.serve_forever(poll_interval=0.2)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"Interrupted. The page has ended; {session.summary()}.") from None
    finally:
        server.server_close()


def record(
    policy: Policy = "crw",
    /,
    *,
    world: WorldOptions = WorldOptions(),
    seed: Seed = 0,
    file: Path | None = None,
    at: Annotated[
        float | None, Parameter(help="Draw one picture at this simulated second, in place of a film.")
    ] = None,
    seconds: float | None = None,
    size: int = 900,
) -> None:
    """Film a run, or draw it at one time.

    'swarm-forage record dpo --at 300 --file dpo.png' draws the run after 300 s.

    Args:
        file: File to write: .gif or .mp4, or .png with --at; default results/SCENARIO_POLICY.gif.
        at: Draw one picture at this simulated second, in place of a film.
        seconds: Simulated seconds to film; default 300, or the whole run where that is shorter.
        size: Longer side of the arena in pixels.
    """
    from swarm_forage_env.cli.worlds import RESULTS, default_file, described_world
    from swarm_forage_env.inspect.film import record_run
    from swarm_forage_env.runs.progress import progress_bar

    chosen, caches = described_world(world)
    ending = ".gif" if at is None else f"_{at:g}_s.png"
    path = file or default_file(RESULTS, chosen, [policy], ending, seed=seed)
    look: dict[str, Any] = {"seed": seed, "size_px": size, "caches": caches}
    if at is not None:
        record_run(chosen, policy, path, at_s=at, **look)
    else:
        with progress_bar("pictures") as progress:
            length = min(300.0, chosen.scenario.horizon_s) if seconds is None else seconds
            record_run(chosen, policy, path, seconds=length, progress=progress, **look)
    say(f"wrote {path}")


def replay(
    policies: Policies,
    /,
    *,
    world: WorldOptions = WorldOptions(),
    seed: Seed = 0,
    file: Path | None = None,
    seconds: float | None = None,
) -> None:
    """Write runs as one HTML file, with play, zoom, every robot's state, and curves.

    The page shows several policies side by side, in the same world with the same seed. In place of policies, you can
    name stored runs (file.parquet), which are made again. The file needs no network.

    Args:
        file: File to write; default results/SCENARIO_POLICIES.html.
        seconds: Simulated seconds to keep; default the whole run.
    """
    from swarm_forage_env._internal.fields import ConfigError
    from swarm_forage_env._internal.files import check_file
    from swarm_forage_env.cli.worlds import RESULTS, default_file, plan_runs
    from swarm_forage_env.inspect.replay.capture import record_replay
    from swarm_forage_env.inspect.replay.files import write_replays
    from swarm_forage_env.runs.progress import progress_bar
    from swarm_forage_env.runs.record import Record

    is_stored = [Path(word).suffix == ".parquet" for word in policies]
    if any(is_stored) and (not all(is_stored) or world != WorldOptions() or seed):
        raise ConfigError("Expected stored runs alone, which have a world and a seed, got policies or options beside.")
    if all(is_stored):
        specs = tuple(Record.read(file).spec for file in policies)
    else:
        specs = plan_runs(world, policies, [seed])
    names, seed = [spec.policy for spec in specs], specs[0].seed
    path = file or default_file(RESULTS, specs[0].world, names, ".html", seed=seed)
    if path.suffix.lower() not in PAGES:
        raise ConfigError(f"Expected a page that ends in {' or '.join(PAGES)}, got {path}; 'record' makes films.")
    check_file(path)
    replays: list[Replay] = []
    for spec in specs:
        with progress_bar(f"{spec.policy}, seed {spec.seed}") as progress:
            replays.append(record_replay(spec, seconds=seconds, progress=progress))
    written = write_replays(path, replays)
    say(f"wrote {written} ({written.stat().st_size / 1e6:.1f} MB)")


def maps(
    policies: Policies,
    /,
    *,
    world: WorldOptions = WorldOptions(),
    seeds: Seeds = 1,
    seed: Seed = 0,
    picture: Picture = None,
) -> None:
    """Draw where robots were, where they took and left objects, and where they got in each other's way.

    The picture has one row per policy. Further rows show the difference of each from the first. The arrays go to .npz
    files beside the picture.
    """
    from swarm_forage_env.cli.worlds import RESULTS, default_file, plan_runs
    from swarm_forage_env.inspect.maps import maps_of_runs, write_maps
    from swarm_forage_env.rendering.figures import check_picture
    from swarm_forage_env.runs.progress import progress_bar

    specs = plan_runs(world, policies, range(seed, seed + seeds))
    file = picture or default_file(RESULTS, specs[0].world, policies, "_maps.png", seed=seed)
    check_picture(file)
    with progress_bar("runs", sum(spec.robot_ticks for spec in specs)) as advance:
        found = maps_of_runs(specs, advance=advance)
    try:
        write_maps(file, found)
    except ImportError as error:
        note(error)
        say(f"wrote maps as .npz files beside {file}, and no picture")
    else:
        say(f"wrote maps to {file} and .npz files beside it")
