"""``mobman view``: a robot or runs in the browser, as a page, as pictures and film."""

from __future__ import annotations

import re
import threading
from pathlib import Path
from typing import Any

import click

from mobman.cli.output import echo, progress_bar

_FILE = click.Path(path_type=Path, dir_okay=False)


@click.command()
@click.argument("what", nargs=-1, required=True, metavar="ROBOT | RUN.h5...")
@click.option("--html", type=_FILE, help="Write one page that opens offline; serve nothing.")
@click.option("--no-browser", is_flag=True, help="Print the address, open no browser.")
@click.option(
    "--port", type=click.IntRange(0, 65535), help="Port to serve on; a free one by default."
)
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to serve on.")
@click.option(
    "--layout",
    type=click.Choice(["overlay", "side-by-side"]),
    default="overlay",
    show_default=True,
    help="Of several runs.",
)
@click.option(
    "--time",
    type=click.FloatRange(min=0.0),
    help="Instant to open at, or of the picture (s).  [default: the beginning; the end of a failed run, "
    "and of a picture]",
)
@click.option("--png", type=_FILE, help="Write a picture.")
@click.option("--gif", type=_FILE, help="Write a film as GIF.")
@click.option("--mp4", type=_FILE, help="Write a film as MP4.")
@click.option(
    "--fps",
    type=click.FloatRange(min=0.0, min_open=True),
    help="Frames a second of a film.  [default: 30; 20 for GIF]",
)
@click.option("--size", metavar="WxH", help="Of a picture or film, pixels.  [default: 1280x720]")
@click.option(
    "--speed",
    type=click.FloatRange(min=0.0, min_open=True),
    default=1.0,
    show_default=True,
    help="Of a film: seconds of the run a second.",
)
def view(
    what: tuple[str, ...],
    html: Path | None,
    no_browser: bool,
    port: int | None,
    host: str,
    layout: Any,
    time: float | None,
    png: Path | None,
    gif: Path | None,
    mp4: Path | None,
    fps: float | None,
    size: str | None,
    speed: float,
) -> None:
    """Look at ROBOT (a name or a TOML file), at a run, or at several runs in one scene.

    Without an option that writes a file, the page is served until Ctrl-C.
    """
    pixels = None if size is None else _pixels(size)
    for option, path, kind in (
        ("--png", png, ".png"),
        ("--gif", gif, ".gif"),
        ("--mp4", mp4, ".mp4"),
    ):
        if path is not None and path.suffix.lower() != kind:
            raise click.BadParameter(f"{str(path)!r} does not end in {kind}", param_hint=option)
    if html is not None and html.suffix.lower() not in (".html", ".htm"):
        raise click.BadParameter(f"{str(html)!r} does not end in .html", param_hint="--html")

    import warnings

    from mobman.viewer.view import View, make_scene

    scene = make_scene(what, layout=layout, time=time)
    for warning in scene.warnings:
        warnings.warn(warning, stacklevel=1)
    films = [path for path in (gif, mp4) if path is not None]
    with View(scene, host=host, port=port) as shown:
        if html is not None:
            _tell("page", shown.save(html))
        if png is not None:
            _tell("picture", shown.save(png, time=time, size=pixels))
        for film in films:
            _film(shown, film, {"fps": fps, "size": pixels, "speed": speed})
        if html is None and png is None and not films:
            _serve(shown, no_browser)


def _serve(shown: Any, no_browser: bool) -> None:
    address = shown.url
    try:  # from when the address is told, Ctrl-C is the way to end it
        echo(f"{shown.scene.title}: {address}  (Ctrl-C ends it)")
        if not no_browser and not shown.open():
            echo("mobman: no browser could be opened; open the address in one", err=True)
        threading.Event().wait()
    except KeyboardInterrupt:
        echo(err=True)


def _film(shown: Any, path: Path, options: dict[str, Any]) -> None:
    with progress_bar(path.name) as progress:
        shown.save(path, **options, progress=progress)
    _tell("film", path)


def _tell(what: str, path: Path) -> None:
    echo(f"{what}: {path} ({path.stat().st_size / 1e6:.2f} MB)")


def _pixels(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d+)[xX×](\d+)", text)
    if found is None:
        raise click.BadParameter(
            f"{text!r} is not WIDTHxHEIGHT, such as 1280x720", param_hint="--size"
        )
    return int(found[1]), int(found[2])
