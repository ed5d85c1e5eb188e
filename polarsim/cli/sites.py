"""Commands for sandboxes and test yards other than NASA's: check-site, new-site."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from polarsim.arguments import writes_file
from polarsim.cli.application import commands_of, print_table

command = commands_of("Own sandboxes")


@command()
def check_site(
    site: Annotated[
        str,
        typer.Argument(metavar="SITE|CONFIG", help="Name of a site that polarsim ships, site file, or configuration."),
    ] = "polar",
    root: Annotated[
        Path | None, typer.Option(help="Folder of the photos and scans; default: source.root of a configuration.")
    ] = None,
) -> None:
    """Print the stages that are possible with a site, and the reasons why others are not.

    With a folder, also counts the photos, scans and calibrations of each terrain, and compares a photo of each camera
    with the image format of the site.

    Exit code 0: valid; 1: invalid, or values are to be filled in.
    """
    from polarsim.running.checked_site import checked_config, is_configuration, values_to_fill_in
    from polarsim.running.found_files import found_files
    from polarsim.running.site_stages import stage_states

    if missing := values_to_fill_in(site):
        print_table(("key", "to be filled in"), missing, f"{site}: values that a person must enter")
        raise typer.Exit(1)
    config = checked_config(site, root)
    states = stage_states(config)
    rows = [(state.stage, "yes" if state.possible else "no", state.reason) for state in states]
    print_table(("stage", "possible", "how, or why not"), rows, f"Site {config.site.name}")
    if config.data_source.has_scans and config.source.root.is_dir() and (root or is_configuration(site)):
        found = found_files(config)
        columns = ("terrain", "photos", "format", "stray files", "scans", "calibration")
        files = [
            (
                one.terrain, f"{one.photos} of {one.expected}", one.format, one.stray, ", ".join(one.scans) or "none",
                one.calibration,
            )
            for one in found
        ]  # fmt: skip
        print_table(columns, files, str(config.source.root))
        for one in found:
            for note in one.notes:
                typer.echo(f"{one.terrain}: {note}")


@command()
def new_site(
    folder: Annotated[Path, typer.Argument(help="Folder with photos, and scans and calibrations if available.")],
    out: Annotated[
        Path, typer.Option(callback=writes_file(".yaml", ".yml"), help="Site file to write; existing files are kept.")
    ] = Path("site.yaml"),
) -> None:
    """Write a draft of a site file from the names and contents of the files in a folder.

    Values that files do not show, such as the positions of lamps, are marked FILL_IN; check-site lists them.
    """
    from polarsim.acquire.new_site import write_draft
    from polarsim.errors import ConfigError

    if out.exists():
        raise ConfigError("exists and is not overwritten: give another name with --out", path=out)
    for line in write_draft(folder, out):
        typer.echo(line)
