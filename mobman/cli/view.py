"""``mobman view``: a robot or runs in the browser, as a page, as pictures and film; and ``mobman
export``: as files of other tools."""

from __future__ import annotations

import re
import threading
import warnings
from pathlib import Path
from typing import Any

from click import BadParameter, Choice, Context, FloatRange, Parameter, argument, command, option

from mobman.cli.options import FILE, FORCE, PORT, POSITIVE, check_new, complete, reports, wants_json
from mobman.cli.output import echo, note, progress_bar, report
from mobman.errors import UsageError

_ENDINGS = {"html": (".html", ".htm"), "png": (".png",), "gif": (".gif",), "mp4": (".mp4",)}


def _ending(context: Context, parameter: Parameter, value: Path | None) -> Path | None:
    allowed = _ENDINGS[str(parameter.name)]
    if value is not None and value.suffix.lower() not in allowed:
        raise BadParameter(f"{str(value)!r} does not end in {allowed[0]}")
    return value


def _pixels(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d+)[xX×](\d+)", text)
    if found is None:
        raise BadParameter(f"{text!r} is not WIDTHxHEIGHT, such as 1280x720")
    return int(found[1]), int(found[2])


_FILE: dict[str, Any] = {"type": FILE, "callback": _ending}
_LAYOUTS = Choice(["overlay", "side-by-side"])
_CAMERAS = "front|back|left|side|top|iso|X,Y,Z"
_SIZE = "Size of a picture or film, pixels.  [default: 1280x720]"
_TIME = (
    "Instant to open at, or of the picture (s).  [default: the beginning; the end of a failed run, and "
    "of a picture]"
)


@command()
@argument("what", nargs=-1, required=True, metavar="ROBOT | RUN.h5...", **complete("robots"))
@option("--html", **_FILE, help="Write one page that opens offline; serve nothing.")
@option("--no-browser", is_flag=True, help="Print the address, open no browser.")
@option("--port", type=PORT, help="Port to serve on; a free one by default.")
@option("--host", default="127.0.0.1", help="Address to serve on.")
@option("--layout", type=_LAYOUTS, default="overlay", help="Layout of several runs.")
@option("--time", type=FloatRange(min=0.0), help=_TIME)
@option("--camera", metavar=_CAMERAS, help="Where to look from: a preset, or a direction.")
@option("--png", **_FILE, help="Write a picture.")
@option("--scale", type=POSITIVE, help="Pixels of the picture for each of --size.  [default: 1]")
@option("--transparent", is_flag=True, help="Picture without background and boxes.")
@option("--gif", **_FILE, help="Write a film as GIF.")
@option("--mp4", **_FILE, help="Write a film as MP4.")
@option("--fps", type=POSITIVE, help="Frames a second of a film.  [default: 30; 20 for GIF]")
@option("--size", metavar="WxH", type=_pixels, help=_SIZE)
@option("--speed", type=POSITIVE, default=1.0, help="Speed of a film: seconds of the run a second.")
@FORCE
@reports
def view(what: tuple[str, ...], html: Path | None, png: Path | None, **given: Any) -> None:
    """Look at ROBOT (a name, a TOML file or a URDF), at a run, or at several runs in one scene.

    Without an option that writes a file, the page is served until Ctrl-C.
    """
    from mobman.viewer.view import View, make_scene

    time, scale, transparent = (given[key] for key in ("time", "scale", "transparent"))
    film = {key: given[key] for key in ("fps", "size", "speed")}
    for path in filter(None, (html, png, given["gif"], given["mp4"])):
        check_new(path, suffixes=[path.suffix.lower()], force=given["force"])
    if png is None and (transparent or scale is not None):
        raise UsageError("--scale and --transparent are for a picture: give --png FILE, too")
    scene = make_scene(what, layout=given["layout"], time=time, camera=given["camera"])
    with View(scene, host=given["host"], port=given["port"]) as shown:
        written: list[tuple[str, Path]] = []
        if html is not None:
            written.append(("page", shown.save(html)))
        if png is not None:
            look = {"scale": scale or 1.0, "transparent": transparent}
            written.append(("picture", shown.save(png, time=time, size=film["size"], **look)))
        for path in filter(None, (given["gif"], given["mp4"])):
            with progress_bar(path.name) as progress:
                written.append(("film", shown.save(path, **film, progress=progress)))
        sizes = [(kind, path, path.stat().st_size) for kind, path in written]
        if written:
            report([{"kind": k, "file": str(path), "bytes": size} for k, path, size in sizes])
        for kind, path, size in sizes:
            echo(f"{kind}: {path} ({size / 1e6:.2f} MB)")
        if not written:
            _serve(shown, given["no_browser"])


def _serve(shown: Any, no_browser: bool) -> None:
    address = shown.url
    try:  # from when the address is printed, Ctrl-C is the way to end it
        # with --json, which stands for the files, it is a message
        echo(f"{shown.scene.title}: {address}  (Ctrl-C ends it)", err=wants_json())
        if not no_browser and not shown.open():
            note("no browser could be opened; open the address in one")
        threading.Event().wait()
    except KeyboardInterrupt:
        echo(err=True)


@command()
@argument("what", metavar="RUN.h5 | ROBOT", **complete("robots"))
@option("-o", "--output", type=FILE, required=True, help=".csv, .mcap or .xml (MuJoCo).")
@FORCE
@reports
def export(what: str, output: Path, force: bool) -> None:
    """Write a run as CSV or MCAP (Foxglove), or a robot, or that of a run, as MuJoCo's XML."""
    from mobman.bridges.export import SUFFIXES
    from mobman.bridges.export import export as write

    check_new(output, suffixes=SUFFIXES, force=force)
    for remark in write(what, output):
        warnings.warn(remark, stacklevel=1)
    size = output.stat().st_size
    report({"file": str(output), "bytes": size})
    echo(f"{output} ({size / 1e6:.2f} MB)")
