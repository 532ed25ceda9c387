"""Parts of HDF5 files of unknown origin, which are opened if they hold their data themselves.

Links, external storage and virtual datasets lead to other files. They are refused, as are filters other
than those that mobman writes. This is called in the process of :mod:`mobman.isolation`.
"""

from __future__ import annotations

import math
from typing import Any

import h5py

from mobman.errors import SpecError

_FILTERS = {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32}
_LINKS = {h5py.h5l.TYPE_SOFT: "a soft link", h5py.h5l.TYPE_EXTERNAL: "an external link"}
_NEEDED = "needed: the data itself"


def own_part(file: h5py.File, place: str) -> h5py.h5g.GroupID | h5py.h5d.DatasetID:
    """A group or a dataset, reached by hard links alone.

    Raises:
        SpecError: If it is not there, or elsewhere.
    """
    found: Any = h5py.h5g.open(file.id, b"/")
    passed = ""
    for part in place.split("/"):
        passed, name = f"{passed}/{part}".lstrip("/"), part.encode()
        if not (isinstance(found, h5py.h5g.GroupID) and name in found):
            raise SpecError(f"{passed} is missing")
        kind = found.links.get_info(name).type
        if kind != h5py.h5l.TYPE_HARD:
            target = _decoded(found.links.get_val(name))
            raise SpecError(f"{passed} is {_LINKS.get(kind, 'a link')} to {target}; {_NEEDED}")
        found = h5py.h5o.open(found, name)
    return found


def own_dataset(file: h5py.File, place: str) -> tuple[h5py.Dataset, int]:
    """A dataset that can be read without reading anything else, and the memory that it takes (bytes).

    Raises:
        SpecError: If it is not there, is no such dataset, or is empty.
    """
    found = own_part(file, place)
    if not isinstance(found, h5py.h5d.DatasetID):
        raise SpecError(f"{place} is not a dataset")
    plan, dataset = found.get_create_plist(), h5py.Dataset(found)
    if plan.get_external_count():
        name = _decoded(plan.get_external(0)[0])
        raise SpecError(f"the values of {place} are in another file, {name}; {_NEEDED}")
    if plan.get_layout() == h5py.h5d.VIRTUAL:
        raise SpecError(f"{place} is a virtual dataset, a view of other files; {_NEEDED}")
    for number in (plan.get_filter(index)[0] for index in range(plan.get_nfilters())):
        if number not in _FILTERS:
            raise SpecError(
                f"{place} is stored by the filter {number}; allowed: gzip, shuffle, fletcher32"
            )
    if dataset.shape is None:
        raise SpecError(f"{place} is empty")
    size = math.prod(dataset.shape) * dataset.dtype.itemsize
    if plan.get_layout() == h5py.h5d.CHUNKED:
        # a chunk is held whole, whatever the shape is
        size = max(size, math.prod(plan.get_chunk()) * dataset.dtype.itemsize)
    return dataset, size


def _decoded(name: Any) -> str:
    parts = name if isinstance(name, tuple) else (name,)
    return ":".join(repr(part.decode("utf-8", errors="replace")) for part in parts)
