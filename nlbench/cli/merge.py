"""`nlbench run --shard`: one shard of a run; `nlbench merge`: the run that all its shards make."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from nlbench.cli import options, output
from nlbench.errors import ConfigError

if TYPE_CHECKING:
    from nlbench.engine.shards import Done

MOST = 64  # groups that are dealt out


def merge(
    config: options.Config,
    source: Annotated[
        list[Path] | None,
        typer.Option("--from", metavar="DIR", help="The --out of shards; repeatable. --out unless given."),
    ] = None,
    runs: options.Runs = None,
    seed: options.Seed = None,
    settings: options.Set = None,
    out: options.Out = Path("results"),
    gate: options.Gate = False,
    plugins: options.Plugin = None,
    json: options.Json = False,
) -> None:
    """Make the run of which all shards were computed with `run --shard`, byte for byte that of one machine."""
    from nlbench.cli.run import computing, finish, gated

    experiment = options.experiment(config, runs, seed, settings)
    gated(config, experiment, gate)

    def merged(show: Any) -> Any:
        from nlbench.engine.shards import merge

        return merge(experiment, source or [out], out, show)

    results = computing(experiment, json, merged)
    finish(experiment, results, gate, json)


def divided(text: str) -> tuple[int, int]:
    """i and n of "i/n". Raises `ConfigError`."""
    given = re.fullmatch(r"([0-9]{1,3})/([0-9]{1,3})", text)
    number, of = (int(part) for part in given.groups()) if given else (0, 0)
    if not 1 <= number <= of <= MOST:
        raise ConfigError(f"--shard: got '{text}'; expected i/n with 1 <= i <= n <= {MOST}, such as 2/3")
    return number, of


def show_shard(
    done: Done, config: Path, stated: dict[str, str | None], settings: list[str] | None, json: bool
) -> None:
    """Say what a shard has, and which command comes next; stated: the options that `merge` needs."""
    number, of = done.share.number + 1, done.share.of
    if json:
        facts = {"shard": number, "of": of, "folder": str(done.folder), "runs": done.runs}
        output.as_json({**facts, "runs_in_all": done.total, "exit_code": 0})
        return
    print(f"shard {number} of {of}: {done.runs:,} of {done.total:,} runs, in {done.folder}")
    command = options.command("merge", config, settings, *options.words(stated))
    output.next_step(command, "once all shards are done; a --from for each folder that has some")
