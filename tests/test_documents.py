"""Documents agree with the code: commands run or parse, configurations are valid, keys, links and paths exist."""

import re
import shlex
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from pathlib import Path
from string import Template
from typing import get_args, get_origin

import pytest
import typer
import yaml
from markdown_it import MarkdownIt
from markdown_it.token import Token
from pydantic import BaseModel
from snakemake.cli import get_argument_parser, parse_config
from snakemake.utils import update_config
from typer.testing import CliRunner

from polarsim import config
from polarsim.cli import app
from polarsim.running.configuration import base_configuration

CHECKOUT = Path(__file__).parent.parent
DOCUMENTS = [
    *(CHECKOUT / name for name in ("README.md", "CONTRIBUTING.md", "config/README.md", "config/rocks/README.md")),
    *(CHECKOUT / name for name in ("data/README.md", "results/README.md")),
    *sorted((CHECKOUT / "docs").rglob("*.md")),
]
SHELL = {"sh", "bash", "console", "shell"}
QUICK = {"brdf", "rules", "schema"}  # commands of polarsim without input files that run within a second
ELSEWHERE = {"pip", "uv", "source", "cd", "apptainer", "docker"}  # programs of other projects
FILES = {".csv", ".json", ".md", ".parquet", ".png", ".smk", ".yaml"}
PATH = re.compile(r"(docs|config|benchmarks|polarsim|workflow|tests)/[\w./*-]+")


def tokens_of(path: Path) -> list[Token]:
    return MarkdownIt("commonmark").enable("table").parse(path.read_text())


def inline_tokens(path: Path) -> list[Token]:
    return [child for token in tokens_of(path) for child in token.children or ()]


def code_of(path: Path) -> list[str]:
    """Return the inline code of a document."""
    return [token.content for token in inline_tokens(path) if token.type == "code_inline"]


def commands_of(path: Path) -> list[str]:
    """Return the command lines in the shell blocks of a document, with the variables of the block replaced."""
    commands = []
    for token in tokens_of(path):
        fenced = token.type == "fence" and token.info.strip() in SHELL
        if not fenced and token.type != "code_block" and not (token.type == "fence" and not token.info):
            continue
        variables: dict[str, str] = {}
        for line in token.content.replace("\\\n", " ").splitlines():
            command = Template(line.strip().removeprefix("$ ")).safe_substitute(variables)
            words = shlex.split(command, comments=True)
            if len(words) == 1 and re.fullmatch(r"\w+=.*", words[0]):
                name, _, variables[name] = words[0].partition("=")
            elif words:
                assert fenced or program(command) in CHECKS, f"{path}: a block without a language contains {line!r}"
                commands.append(command)
    return commands


def program(command: str) -> str:
    words = [word for word in shlex.split(command, comments=True) if not re.match(r"[A-Z_]+=", word)]
    return words[0].removeprefix(".venv/bin/")


def arguments_of(command: str) -> list[str]:
    """Return the arguments of a command, with braces expanded as in a shell."""
    words = [word for word in shlex.split(command, comments=True) if not re.match(r"[A-Z_]+=", word)][1:]
    spread = []
    for word in words:
        braces = re.fullmatch(r"([^{]*)\{([\w,]+)\}(.*)", word)
        spread += [braces[1] + part + braces[3] for part in braces[2].split(",")] if braces else [word]
    return spread


def check_make(arguments: list[str]) -> None:
    targets = set(re.findall(r"^([a-z-]+):", (CHECKOUT / "Makefile").read_text(), re.MULTILINE))
    for target in arguments:
        assert "=" in target or target in targets


def check_polarsim(arguments: list[str]) -> None:
    name, *rest = arguments
    if name == "--help" or name in QUICK or "--help" in rest:
        done = CliRunner().invoke(app, arguments)
        assert done.exit_code == 0, done.output
        return
    group = typer.main.get_command(app)
    group.commands[name].make_context(name, rest)


def check_snakemake(arguments: list[str]) -> None:
    """Check that options parse, the configuration is valid, and targets are rules or outputs of rules."""
    given = get_argument_parser().parse_args(arguments)
    merged: dict = {}
    named = [CHECKOUT / file for file in given.configfile or ()]
    shipped = [file for file in named if file.parent.name == "config" or file.exists()]  # without files of the reader
    for file in [*(CHECKOUT / base for base in base_configuration(shipped)), *shipped]:
        update_config(merged, yaml.safe_load(file.read_text()))
    update_config(merged, parse_config(given.config))
    run = config.parse_config(merged).run
    for profile in given.profile or []:
        assert (CHECKOUT / profile / "config.yaml").exists()
    for target in given.targets:
        assert target in rules() or any(made.fullmatch(target) for made in outputs(run)), target


@cache
def rules() -> set[str]:
    files = (CHECKOUT / "workflow/Snakefile", *(CHECKOUT / "workflow/rules").glob("*.smk"))
    texts = [path.read_text() for path in files]
    return {
        name
        for text in texts
        for name in re.findall(r"^\s*(?:use )?rule (?:\w+ as )?(\w+)(?: with)?:", text, re.MULTILINE)
    }


@cache
def outputs(run: str) -> list[re.Pattern]:
    """Return patterns of the outputs of rules in `results/`; `run` is this run or a run of the reader."""
    texts = [path.read_text() for path in (CHECKOUT / "workflow/rules").glob("*.smk")]
    names = {name for text in texts for name in re.findall(r'"(results/\{+run\}+/[^"]+)"', text)}
    return [re.compile(re.sub(r"\\\{+\w+\\\}+", "[^/]+", re.escape(name))) for name in sorted(names)]


def check_python(arguments: list[str]) -> None:
    if arguments[0] == "-m" and arguments[1].startswith("benchmarks."):
        arguments = [f"{arguments[1].replace('.', '/')}.py", *arguments[2:]]
    if arguments[0] == "-m":
        assert arguments[1] == "pytest"
        assert (CHECKOUT / arguments[2]).exists()
        return
    script, *rest = arguments
    text = (CHECKOUT / script).read_text()
    for word in rest:
        if word.startswith("--"):
            assert f'"{word.partition("=")[0]}"' in text, word


CHECKS = {"make": check_make, "polarsim": check_polarsim, "snakemake": check_snakemake, "python": check_python}
COMMANDS = sorted({command for path in DOCUMENTS for command in commands_of(path)})


@pytest.mark.parametrize("command", COMMANDS)
def test_commands_in_code_blocks_run_or_parse(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if program(command) not in ELSEWHERE:
        CHECKS[program(command)](arguments_of(command))


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(CHECKOUT)))
def test_commands_in_the_text_exist(path):
    group = typer.main.get_command(app)
    for code in code_of(path):
        words = code.split()
        if words[0] == "polarsim" and len(words) > 1 and not words[1].isupper() and not words[1].startswith("-"):
            command = group.commands[words[1]]
            known = {name for option in command.params for name in (*option.opts, *option.secondary_opts)} | {"--help"}
            assert {word for word in words if word.startswith("--")} <= known, code
        if words[0] in ("make", "python", "snakemake") and len(words) > 1:
            CHECKS[words[0]](arguments_of(code))


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(CHECKOUT)))
def test_links_anchors_and_paths_exist(path):
    for token in inline_tokens(path):
        target = token.attrGet("href") if token.type == "link_open" else token.attrGet("src")
        if target and not re.match(r"\w+:", str(target)):
            file, _, anchor = str(target).partition("#")
            linked = (path.parent / file).resolve() if file else path
            assert linked.exists(), target
            assert not anchor or anchor in anchors(linked), target
    for code in code_of(path):
        if PATH.fullmatch(code) and not re.search(r"NN|TT|/$", code):
            assert list(CHECKOUT.glob(code)), code


def anchors(path: Path) -> set[str]:
    """Return the anchors of the headings of a page, as MyST and GitHub form them."""
    tokens = tokens_of(path)
    titles = [tokens[at + 1] for at, token in enumerate(tokens) if token.type == "heading_open"]
    texts = ["".join(child.content for child in title.children or ()) for title in titles]
    headings = {re.sub(r"[^\w\- ]", "", text.lower()).replace(" ", "-") for text in texts}
    parts = [token.info.split()[1] for token in tokens if token.info.startswith("{include}")]
    return headings.union(*(anchors(path.parent / part) for part in parts))


# The file `site.yaml` of docs/howto/own_sandbox.md.
SITE_OF_READER = yaml.safe_load((CHECKOUT / "config/sites/yard.yaml").read_text()) | {
    "terrains": ["a", "b"],
    "analog": {},
}


def test_configurations_in_code_blocks_are_valid():
    shown = 0
    for path in DOCUMENTS:
        for token in tokens_of(path):
            content = yaml.safe_load(token.content) if token.type == "fence" and token.info.strip() == "yaml" else None
            if isinstance(content, dict) and set(content) <= set(config.Config.model_fields):
                base = "yard" if "site" in content else "polar"
                merged = yaml.safe_load((CHECKOUT / f"config/{base}.yaml").read_text())
                update_config(
                    merged, content | ({"site": SITE_OF_READER} if content.get("site") == "site.yaml" else {})
                )
                config.parse_config(merged)
                shown += 1
    assert shown >= 5


def keyed(model: type[BaseModel], names: list[str]) -> bool:
    """Return whether a path of names is a key of the configuration; dictionary keys may have any name."""
    if names[0] not in model.model_fields:
        return False
    annotation = model.model_fields[names[0]].annotation
    rest = names[2:] if get_origin(annotation) is dict else names[1:]
    below = list(models_in(annotation))
    return not rest or any(keyed(part, rest) for part in below)


def models_in(annotation: object) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from models_in(part)


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(CHECKOUT)))
def test_keys_and_modules_in_the_text_exist(path):
    for code in code_of(path):
        if re.fullmatch(r"polarsim(\.\w+)+", code):
            module, _, name = code.rpartition(".")
            assert hasattr(import_module(module), name) or import_module(code), code
        key = re.match(r"([a-z_]+(?:\.[A-Za-z_0-9]+)+)(?:[:=].*)?$", code)
        if not key or key[1].split(".")[0] not in config.Config.model_fields or Path(code).suffix in FILES:
            continue
        module, _, name = f"polarsim.{key[1]}".rpartition(".")
        if not keyed(config.Config, key[1].split(".")):
            assert hasattr(import_module(module), name), code
