"""``mobman view``: a robot or runs in the browser, as a page, as pictures and film."""

from __future__ import annotations

import re
import threading
import warnings
from pathlib import Path
from typing import Any

import click

from mobman.cli.names import complete
from mobman.cli.output import FILE, PORT, POSITIVE, echo, print_json, reports
from mobman.cli.progress import progress_bar
from mobman.errors import UsageError

_ENDINGS = {"html": (".html", ".htm"), "png": (".png",), "gif": (".gif",), "mp4": (".mp4",)}


def _ending(context: click.Context, parameter: click.Parameter, value: Path | None) -> Path | None:
    allowed = _ENDINGS[str(parameter.name)]
    if value is not None and value.suffix.lower() not in allowed:
        raise click.BadParameter(f"{str(value)!r} does not end in {allowed[0]}")
    return value


def _pixels(
    context: click.Context, parameter: click.Parameter, value: str | None
) -> tuple[int, int] | None:
    if value is None:
        return None
    found = re.fullmatch(r"(\d+)[xX×](\d+)", value)
    if found is None:
        raise click.BadParameter(f"{value!r} is not WIDTHxHEIGHT, such as 1280x720")
    return int(found[1]), int(found[2])


@click.command()
@click.argument("what", nargs=-1, required=True, metavar="ROBOT | RUN.h5...", **complete("robots"))
@click.option(
    "--html",
    type=FILE,
    callback=_ending,
    help="Write one page that opens offline; serve nothing.",
)
@click.option("--no-browser", is_flag=True, help="Print the address, open no browser.")
@click.option("--port", type=PORT, help="Port to serve on; a free one by default.")
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to serve on.")
@click.option(
    "--layout",
    type=click.Choice(["overlay", "side-by-side"]),
    default="overlay",
    show_default=True,
    help="Layout of several runs.",
)
@click.option(
    "--time",
    type=click.FloatRange(min=0.0),
    help="Instant to open at, or of the picture (s).  [default: the beginning; the end of a failed run, "
    "and of a picture]",
)
@click.option(
    "--camera",
    metavar="front|back|left|side|top|iso|X,Y,Z",
    help="Where to look from: a preset, or a direction.",
)
@click.option("--png", type=FILE, callback=_ending, help="Write a picture.")
@click.option(
    "--scale", type=POSITIVE, help="Pixels of the picture for each of --size.  [default: 1]"
)
@click.option("--transparent", is_flag=True, help="Picture without background and boxes.")
@click.option("--gif", type=FILE, callback=_ending, help="Write a film as GIF.")
@click.option("--mp4", type=FILE, callback=_ending, help="Write a film as MP4.")
@click.option("--fps", type=POSITIVE, help="Frames a second of a film.  [default: 30; 20 for GIF]")
@click.option(
    "--size",
    metavar="WxH",
    callback=_pixels,
    help="Size of a picture or film, pixels.  [default: 1280x720]",
)
@click.option(
    "--speed",
    type=POSITIVE,
    default=1.0,
    show_default=True,
    help="Speed of a film: seconds of the run a second.",
)
@reports
def view(
    what: tuple[str, ...],
    html: Path | None,
    no_browser: bool,
    port: int | None,
    host: str,
    layout: Any,
    time: float | None,
    camera: str | None,
    png: Path | None,
    scale: float | None,
    transparent: bool,
    gif: Path | None,
    mp4: Path | None,
    as_json: bool,
    **film: Any,
) -> None:
    """Look at ROBOT (a name or a TOML file), at a run, or at several runs in one scene.

    Without an option that writes a file, the page is served until Ctrl-C.
    """
    from mobman.viewer.view import View, make_scene

    if png is None and (transparent or scale is not None):
        raise UsageError("--scale and --transparent are for a picture: give --png FILE, too")
    scene = make_scene(what, layout=layout, time=time, camera=camera)
    for warning in scene.warnings:
        warnings.warn(warning, stacklevel=1)
    with View(scene, host=host, port=port) as shown:
        written: list[tuple[str, Path]] = []
        if html is not None:
            written.append(("page", shown.save(html)))
        if png is not None:
            look = {"scale": scale or 1.0, "transparent": transparent}
            written.append(("picture", shown.save(png, time=time, size=film["size"], **look)))
        for path in filter(None, (gif, mp4)):
            with progress_bar(path.name) as progress:
                shown.save(path, **film, progress=progress)
            written.append(("film", path))
        if as_json and written:
            sizes = [(kind, path, path.stat().st_size) for kind, path in written]
            print_json([{"kind": k, "file": str(path), "bytes": size} for k, path, size in sizes])
        else:
            for kind, path in written:
                echo(f"{kind}: {path} ({path.stat().st_size / 1e6:.2f} MB)")
        if not written:
            _serve(shown, no_browser)


def _serve(shown: Any, no_browser: bool) -> None:
    address = shown.url
    try:  # from when the address is printed, Ctrl-C is the way to end it
        echo(f"{shown.scene.title}: {address}  (Ctrl-C ends it)")
        if not no_browser and not shown.open():
            echo("mobman: no browser could be opened; open the address in one", err=True)
        threading.Event().wait()
    except KeyboardInterrupt:
        echo(err=True)
