"""Claim: code runs only when the user names its file; what is broken is said in a line; results know whose they are."""

from __future__ import annotations

import json
import pickle
import re
import subprocess
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
from typer.testing import CliRunner

import nlbench as nb
from nlbench import config, plugins
from nlbench.cli.app import app
from nlbench.config.assemble import Named
from nlbench.errors import ConfigError, EnvironmentFault
from nlbench.plugins import installed
from nlbench.plugins.signature import RESERVED
from tests.small_runs import python

SYSTEM = """
from pathlib import Path
import jax.numpy as jnp
import numpy as np
import nlbench as nb

Path("executed").touch()

def walk(variance: float = 1.0, interval: float = 0.2):
    "A random walk."
    return nb.System(
        drift=lambda t, x: 0.0 * x,
        observe=lambda t, x: x,
        measurement_cov=np.array([[variance]]),
        initial=nb.Moments(mean=np.zeros(1), cov=np.eye(1)),
        diffusion=lambda t, x: jnp.eye(1),
        interval=interval,
    )

SYSTEMS = {"walk": walk}
"""
FILTER = """
from nlbench.discrete import gaussian, linearised
from nlbench.discrete.catalogue import PropagatedOptions

def mine(system, options: PropagatedOptions):
    "Mine."
    return gaussian.build("mine", system, options, linearised.step, linearised.local, linearised.update)

FILTERS = {"mine": mine}
"""
EXPERIMENT = """\
# Is it?
experiment: own
system: {name: walk, variance: 0.5}
filters: [ekf]
time: {end: 0.4, step: 0.1, output: 0.2}
monte_carlo: {runs: 64}
"""


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    """A folder with a plug-in and an experiment, and nothing allowed before or after."""
    monkeypatch.chdir(tmp_path)
    Path("walk.py").write_text(SYSTEM)
    Path("mine.py").write_text(FILTER)
    Path("own.yaml").write_text(EXPERIMENT)
    yield
    plugins.forget()


def command(*arguments: str):
    return CliRunner().invoke(app, list(arguments))


def problems(*arguments: str) -> str:
    """What a command complains of, which ends with 2 and has written nothing."""
    before = sorted(Path.cwd().iterdir())
    done = command(*arguments)
    assert done.exit_code == 2, done.output
    assert "Traceback" not in done.stderr
    assert [
        path for path in sorted(Path.cwd().iterdir()) if path not in before and path.name != "executed"
    ] == []
    return done.stderr


@pytest.mark.parametrize("name", ["walk", "walk.py:walk", "walk:walk"])
def test_an_experiment_alone_runs_nothing_and_says_which_option_allows_it(name):
    Path("own.yaml").write_text(EXPERIMENT.replace("name: walk", f"name: '{name}'"))
    for verb in ("validate", "run", "plan"):
        assert "--plugin" in problems(verb, "own.yaml")
    assert not Path("executed").exists()


def test_a_key_of_the_file_gives_no_permission():
    Path("own.yaml").write_text(
        EXPERIMENT
        + "plugins: [{file: walk.py, digest: x, path: walk.py, source: 'print(1)', systems: {walk: "
        "{discrete: false, continuous: false}}}]\n"
    )
    assert "unknown system 'walk'" in problems("run", "own.yaml")
    assert not Path("executed").exists()


def test_what_was_allowed_once_is_not_allowed_to_the_next_command():
    assert command("validate", "own.yaml", "--plugin", "walk.py").exit_code == 0
    assert "unknown system" in problems("validate", "own.yaml")


def test_allowed_names_are_listed_and_checked_like_built_in_ones():
    assert "walk" in command("list", "systems", "--plugin", "walk.py").stdout
    assert "limiter" in command("list", "filters", "mine", "--plugin", "mine.py").stdout
    Path("own.yaml").write_text(
        EXPERIMENT.replace("variance", "varance").replace("[ekf]", "[{name: mine, limter: 1}]")
    )
    said = problems("validate", "own.yaml", "--plugin", "walk.py", "--plugin", "mine.py")
    assert "system.varance: unknown key; did you mean 'variance'?" in said
    assert "filters.0.limter: unknown key; did you mean 'limiter'?" in said
    Path("own.yaml").write_text(EXPERIMENT.replace("name: walk", "name: wlak"))
    assert "unknown system 'wlak'; did you mean 'walk'?" in problems(
        "validate", "own.yaml", "--plugin", "walk.py"
    )


BROKEN = {
    "file missing": (None, "none.py: cannot read the plug-in: no such file"),
    "syntax": ("def f(:\n", "bad.py:1:7: importing it failed: SyntaxError"),
    "import raises": ("\nimport nonexistent_module\n", "bad.py:2: importing it failed: ModuleNotFoundError"),
    "import exits": ("raise SystemExit(0)\n", "bad.py:1: importing it failed: SystemExit"),
    "declares nothing": ("x = 1\n", "bad.py: declares nothing; expected a line such as SYSTEMS = "),
    "no dict": ("SYSTEMS = ['walk']\n", "SYSTEMS: expected a dict such as"),
    "a name with spaces": ("def f(): pass\nSYSTEMS = {'a walk': f}\n", "expected a name of a-z 0-9 -"),
    "no function": ("SYSTEMS = {'walk': 3}\n", "system 'walk': expected a function, found int"),
    "signature of a system": (
        "def f(**k): pass\nSYSTEMS = {'walk': f}\n",
        "bad.py:1: system 'walk': wrong signature",
    ),
    "signature of a filter": (
        "def f(): pass\nFILTERS = {'g': f}\n",
        "expected (system, option=default, ...)",
    ),
    "parameters": (
        "import numpy as np\ndef f(a: np.ndarray = None): pass\nSYSTEMS = {'walk': f}\n",
        "parameters must be float, int, bool, str",
    ),
    "a system's parameter called name": (
        "def f(name: str = 'x'): pass\nSYSTEMS = {'walk': f}\n",
        "bad.py:1: system 'walk': 'name' means something else beside its name in an experiment",
    ),
    "a result's annotation": (
        "from __future__ import annotations\nimport nlbench as nb\n"
        "def f(a: float = 1.0) -> nb.Sytem: pass\nSYSTEMS = {'walk': f}\n",
        "bad.py:3: system 'walk': its signature cannot be read: annotation 'nb.Sytem' of what it returns: AttributeE",
    ),
    "a parameter's annotation": (
        "from __future__ import annotations\ndef f(a: flaot = 1.0): pass\nSYSTEMS = {'walk': f}\n",
        "annotation 'flaot' of 'a': NameError: name 'flaot' is not defined",
    ),
    "a model without names": (
        "import pydantic\ndef f(a: pydantic.RootModel[int]): pass\nSYSTEMS = {'walk': f}\n",
        "bad.py:2: system 'walk': RootModel[int] is no model of named parameters",
    ),
    "a built-in name": ("SYSTEMS = {'oscillator': print}\nprint = None\n", "wrong signature"),
    "a built-in name, well formed": (
        "def f(): pass\nSYSTEMS = {'oscillator': f}\n",
        "'oscillator' is a built-in name",
    ),
    "factory raises": (
        SYSTEM.replace("return", "1 / 0; return"),
        "bad.py:11: system 'walk': making it failed: Zero",
    ),
    "factory returns": (
        SYSTEM.replace("return nb.System", "return dict"),
        "made a dict, expected a nlbench.System",
    ),
    "factory's types": (SYSTEM.replace("drift=", "drfit="), "system 'walk': making it failed: TypeError"),
    "drift": (SYSTEM.replace("0.0 * x", "jnp.zeros(2)"), "drift(t, x): got shape (2,), expected (1,)"),
    "drift raises": (
        SYSTEM.replace("0.0 * x", "x[0] @ x"),
        "drift(t, x): raises ValueError for shape (1,): ",
    ),
    "drift says nothing": (
        SYSTEM.replace("drift=lambda t, x: 0.0 * x", "drift=drift").replace(
            "SYSTEMS", "def drift(t, x):\n    assert x.shape == (3,)\n\nSYSTEMS"
        ),
        "drift(t, x): raises AssertionError for shape (1,)\n",
    ),
    "observe": (
        SYSTEM.replace("lambda t, x: x,", "lambda t, x: jnp.zeros(2),"),
        "bad.py:13: observe(t, x): got shape (2,), expected (1,)",
    ),
    "diffusion": (SYSTEM.replace("jnp.eye(1)", "jnp.zeros((2, 3))"), "diffusion(t, x): got shape (2, 3)"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_plugin_is_one_clear_line_before_anything_is_compiled(case, monkeypatch):
    def compiled(*arguments):
        raise AssertionError("compiled")

    monkeypatch.setattr("nlbench.engine.driver.compile_chunks", compiled)
    text, message = BROKEN[case]
    if text is not None:
        Path("bad.py").write_text(text)
    said = problems("run", "own.yaml", "--plugin", "none.py" if text is None else "bad.py")
    assert message in said
    assert len([line for line in said.splitlines() if not line.startswith("    ")]) == 1


@pytest.mark.parametrize("option", ["name", "label", "model", "initial"])
@pytest.mark.parametrize("own", [True, False], ids=["of a model", "of a function"])
def test_an_option_that_an_experiment_could_never_give_is_refused_when_the_plugin_is_loaded(option, own):
    model = f"class Options(pydantic.BaseModel):\n    {option}: float = 1.0\n"
    takes = "options: Options" if own else f"{option}=1.0"
    Path("bad.py").write_text(f"import pydantic\n{model}def f(system, {takes}): pass\nFILTERS = {{'g': f}}\n")
    assert f"filter 'g': '{option}' means something else" in problems("list", "filters", "--plugin", "bad.py")


def test_what_an_experiment_says_beside_a_name_is_what_options_may_not_be_called():
    assert set(RESERVED["filters"]) == set(Named.model_fields)


def test_a_name_that_two_files_bring_is_refused_also_where_both_are_allowed_at_once():
    Path("other.py").write_text(SYSTEM + "\n")
    said = problems("list", "systems", "--plugin", "walk.py", "--plugin", "other.py")
    assert said == "other.py: systems: 'walk' is already that of walk.py\n"
    Path("other.py").write_text(SYSTEM)
    assert command("list", "systems", "--plugin", "walk.py", "--plugin", "other.py").exit_code == 0


def test_names_can_move_from_file_to_file():
    nb.allow("walk.py")
    Path("other.py").write_text(SYSTEM + "\n")
    Path("walk.py").write_text(FILTER)
    nb.allow("walk.py", "other.py")
    assert plugins.find("systems", "walk")[0].file == "other.py"


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("{name: mine, fadign: 2}", "filters.0.fadign: unknown key; did you mean 'fading'?"),
        ("{name: mine, fading: .inf}", "filters.0.fading: expected a number, found .inf"),
    ],
)
def test_a_plain_model_refuses_what_all_options_refuse(entry, message):
    Path("mine.py").write_text(
        FILTER.replace("from nlbench.discrete.catalogue import PropagatedOptions", "import pydantic").replace(
            "def mine(system, options: PropagatedOptions)",
            "class Options(pydantic.BaseModel):\n    fading: float = 1.0\n    limiter: float | None = None\n\n"
            "def mine(system, options: Options)",
        )
    )
    Path("own.yaml").write_text(EXPERIMENT.replace("[ekf]", f"[{entry}]"))
    assert message in problems("validate", "own.yaml", "--plugin", "walk.py", "--plugin", "mine.py")
    Path("own.yaml").write_text(EXPERIMENT.replace("[ekf]", "[{name: mine, fading: 2}]"))
    done = command("validate", "own.yaml", "--plugin", "walk.py", "--plugin", "mine.py")
    assert done.exit_code == 0, done.output


def test_validate_says_what_shape_does_not_fit():
    Path("walk.py").write_text(BROKEN["drift"][0])
    said = problems("validate", "own.yaml", "--plugin", "walk.py")
    assert said.startswith(f"walk.py:12: {BROKEN['drift'][1]}\n")


UNFIT = {
    "return 3": "filter 'mine': made a int, expected a nlbench.filters.filter.Filter",
    "return made._replace(init=lambda m, key=None: 1 / 0)": "init(moments): raises ZeroDivisionError",
    "return made._replace(update=lambda s, t, y, key=None: s)": "expected (state, UpdateInfo)",
    "return made._replace(integrate=lambda s, t, h, c: (s.mean, s.cov))": "integrate(state, t, h, count): got a state",
    "return made._replace(integrate=lambda s, t, h, c: s._replace(mean=s.cov))": "expected (1,) float64 as of init",
    "return made._replace(update=lambda s, t, y, key=None: (s, made.update(s, t, y)[1]._replace(guarded=None)))":
        "update(state, t, y): guarded: got None, expected ()",
    "return made._replace(moments=lambda s: nb.Moments([s.mean], s.cov))": "mean: got list, expected (1,)",
    "return made._replace(system=None)": "system: expected the system that the factory is given",
    "return made._replace(moments=lambda s: nb.Moments(s.cov, s.cov))": "mean: got shape (1, 1), expected (1,)",
    "return made._replace(components=lambda s: None)": "components(state): mean: got 0 components, expected 1",
}  # fmt: skip


@pytest.mark.parametrize("ending", UNFIT)
def test_a_filter_that_does_not_fit_is_one_clear_line(ending):
    Path("mine.py").write_text("import nlbench as nb" + FILTER.replace("return", "made =").replace(
        "\n\nFILTERS", f"\n    {ending}\n\nFILTERS"
    ))  # fmt: skip
    Path("own.yaml").write_text(EXPERIMENT.replace("[ekf]", "[mine]"))
    said = problems("run", "own.yaml", "--plugin", "walk.py", "--plugin", "mine.py")
    assert UNFIT[ending] in said
    assert all(re.match(r"mine\.py(:\d+)?: filter 'mine': ", line) for line in said.splitlines())


SIGHTED = {
    "made._replace(angle=None)": "angle: got None, expected a function of the state",
    "made._replace(angle=lambda s: s.mean)": "angle(state): got shape (4,), expected ()",
    "made._replace(update=lambda s, t, y, key=None: made.update(s, t, y))":
        "update(state, t, y, sighting=number): raises TypeError: ",
}  # fmt: skip


@pytest.mark.parametrize("ending", SIGHTED)
def test_a_filter_that_knows_no_sightings_is_refused_by_a_system_that_has_them(ending):
    text = FILTER.replace("return", "made =").replace("\n\nFILTERS", f"\n    return {ending}\n\nFILTERS")
    Path("mine.py").write_text(text)
    nb.allow("mine.py")
    with pytest.raises(ConfigError) as raised:
        nb.filters.build("mine", nb.systems.build("lunar-orbit"))
    assert f"filter 'mine': {SIGHTED[ending]}" in str(raised.value)


def test_a_filter_that_knows_sightings_is_taken_by_a_system_that_has_them():
    nb.allow("mine.py")
    assert nb.filters.build("mine", nb.systems.build("lunar-orbit")).angle is not None


def test_the_source_is_part_of_the_identity_and_its_place_is_not(tmp_path):
    def identity() -> str:
        nb.allow("walk.py")
        return config.load("own.yaml").hash12()

    first = identity()
    Path("walk.py").write_text(SYSTEM.replace("0.0 * x", "0.0 * x + 0"))
    assert identity() != first
    (tmp_path / "elsewhere").mkdir()
    plugins.forget()
    (tmp_path / "elsewhere" / "walk.py").write_text(SYSTEM)
    nb.allow(tmp_path / "elsewhere" / "walk.py")
    assert config.load("own.yaml").hash12() == first


def test_experiments_without_plugins_are_written_as_before():
    Path("plain.yaml").write_text(EXPERIMENT.replace("{name: walk, variance: 0.5}", "culver-scalar"))
    assert "plugins" not in config.load("plain.yaml").resolved()


def test_another_process_gets_the_source_that_was_allowed_and_not_what_stands_in_the_file_now(tmp_path):
    nb.allow("walk.py")
    (tmp_path / "sent").write_bytes(pickle.dumps(config.load("own.yaml")))
    Path("walk.py").write_text("raise SystemExit('run again')")
    Path("executed").unlink()
    program = """
import pickle, sys
from pathlib import Path
from nlbench.engine.problem import make
print(make(pickle.loads(Path(sys.argv[1]).read_bytes())).truth.measurement_cov)
"""
    done = python(program, str(tmp_path / "sent"))
    assert (done.stdout, done.returncode) == ("[[0.5]]\n", 0), done.stderr
    assert Path("executed").exists()


def test_results_are_read_without_the_plugin_and_not_run_without_it():
    nb.allow("walk.py", "mine.py")
    Path("own.yaml").write_text(EXPERIMENT.replace("[ekf]", "[ekf, mine]"))
    stated = config.load("own.yaml")
    Path("recorded.yaml").write_text(stated.resolved_yaml())
    plugins.forget()
    Path("executed").unlink()
    read = config.load("recorded.yaml", recorded=True)
    assert read == stated
    assert read.hash12() == stated.hash12()
    with pytest.raises(ConfigError, match=r"allow it with --plugin walk\.py"):
        nb.run(read)
    assert "unknown system" in problems("run", "recorded.yaml")
    assert not Path("executed").exists()
    assert command("validate", "recorded.yaml", "--plugin", "walk.py", "--plugin", "mine.py").exit_code == 0
    Path("walk.py").write_text(SYSTEM + "\n")
    said = problems("validate", "recorded.yaml", "--plugin", "walk.py", "--plugin", "mine.py")
    assert "made with other code of walk.py" in said


def test_a_run_is_verified_with_its_plugin_and_not_without_or_with_another():
    nb.allow("walk.py")
    folder = str(nb.run("own.yaml").path)
    plugins.forget()
    found = json.loads(command("verify", folder, "--plugin", "walk.py", "--json").stdout)
    assert (found["exit_code"], found["same"], found["block"]) == (0, True, 0)
    Path("executed").unlink()
    assert "allow it with --plugin walk.py" in problems("verify", folder)
    assert not Path("executed").exists()
    Path("walk.py").write_text(SYSTEM + "\n")
    assert "made with other code of walk.py" in problems("verify", folder, "--plugin", "walk.py")


@pytest.mark.long
def test_a_finished_run_is_not_believed_where_the_plugin_makes_another_program(monkeypatch):
    """What a plug-in imports or reads is not in its source: here, an environment variable."""
    text = SYSTEM.replace("0.0 * x", "float(os.environ['RATE']) * x").replace(
        "from pathlib", "import os\nfrom pathlib"
    )
    Path("walk.py").write_text(text)
    monkeypatch.setenv("RATE", "0.5")
    nb.allow("walk.py")
    first = nb.run("own.yaml")
    assert nb.run("own.yaml").path == first.path
    monkeypatch.setenv("RATE", "0.25")
    with pytest.raises(EnvironmentFault, match="computed by another program"):
        nb.run("own.yaml")


def test_an_installed_package_brings_names_without_an_option(tmp_path):
    package = tmp_path / "site" / "walks"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "random.py").write_text(SYSTEM)
    facts = tmp_path / "site" / "walks-1.0.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: walks\nVersion: 1.0\n")
    (facts / "entry_points.txt").write_text(
        "[nlbench.systems]\nwalk = walks.random:walk\nlost = walks.lost:walk\n"
    )

    def said(*arguments: str) -> subprocess.CompletedProcess:
        program = "import sys; sys.path.insert(0, sys.argv.pop(1)); from nlbench.cli import main; main()"
        return python(program, str(tmp_path / "site"), *arguments)

    first = said("validate", "own.yaml", "--json")
    assert '"file": "walks"' in first.stdout, first.stderr
    (package / "helper.py").write_text("x = 1\n")
    assert (
        said("validate", "own.yaml", "--json").stdout.split('"hash"')[1][:20]
        != first.stdout.split('"hash"')[1][:20]
    )
    Path("own.yaml").write_text(EXPERIMENT.replace("name: walk", "name: lost"))
    done = said("validate", "own.yaml")
    assert done.returncode == 2
    assert "(system 'lost', installed): importing it failed: ModuleNotFoundError" in done.stderr
    for command in (["list", "systems"], ["schema"]):
        done = said(*command)
        assert done.returncode == 0, done.stderr
        assert '"walk"' in done.stdout or "  walk " in done.stdout
        assert "lost" not in done.stdout
        (line,) = done.stderr.splitlines()
        assert line.startswith("walks.lost:walk (system 'lost', installed): importing it failed: ")
        assert line.endswith("; left out")
    Path("own.yaml").write_text(EXPERIMENT)
    assert (
        "already that of an installed package" in said("validate", "own.yaml", "--plugin", "walk.py").stderr
    )


def test_an_installed_package_that_is_gone_stops_nobody_who_needs_another(monkeypatch):
    gone = EntryPoint("gone", "no_such_package.systems:gone", "nlbench.systems")
    monkeypatch.setattr(installed, "_points", lambda kind: {"gone": gone} if kind == "systems" else {})
    nb.allow("walk.py")
    stated = config.load("own.yaml")
    plugins.forget()
    plugins.restore(stated.plugins)
    assert plugins.find("systems", "walk") is not None
    with pytest.raises(ConfigError, match="no_such_package"):
        plugins.find("systems", "gone")
