"""Make what the gallery shows: live playbacks for the site, and moving pictures.

``python docs/make_gallery.py FOLDER`` writes a playback of each entry of docs/gallery.yaml,
``FOLDER/NAME.html``. ``python docs/make_gallery.py --pictures`` writes the moving pictures in
docs/gallery/ and of the README; these need what `drake-rnn film` needs. ``--only NAME`` makes some
of them. The runs are kept in build/gallery_runs until the code changes.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from gallery_page import DOCS, gallery, runs_of

from drake_rnn import FilmSettings, Result, load_experiment, simulate, write_film, write_playback
from drake_rnn.experiment import read_document
from drake_rnn.experiment.files import (
    row_key,
    surroundings,
)

PICTURES = DOCS / "gallery"
#: Folder of the runs, and the name of what says of each what made it.
RUNS, _MARK = DOCS.parent / "build" / "gallery_runs", "gallery_key.txt"
#: Frame rate of playbacks on the site [1/s], which keeps their files small.
_RATE = 32
#: How much less than its bound a figure may be: what is learned differs between processors, which
#: round sums in another order.
_LOOSE = 2.5


def _key(name: str) -> str:
    """Return what a run of an experiment depends on, with the code and the versions."""
    document = read_document(name)
    return row_key(document, surroundings(document), "gallery")


def is_kept(name: str, folder: Path = RUNS) -> bool:
    """Return whether a folder has a run of an experiment that this code would make again."""
    mark = folder / name / _MARK
    return mark.is_file() and mark.read_text() == _key(name)


def kept_result(name: str, folder: Path) -> Result:
    """Return the result of an experiment, which is run if no run of it is kept in a folder."""
    place, mark = folder / name, folder / name / _MARK
    if is_kept(name, folder):
        return Result.load(place)
    mark.unlink(missing_ok=True)
    result = simulate(load_experiment(name))
    result.save(place)
    mark.write_text(_key(name))
    return result


def check_figures(entry: Mapping[str, Any], folder: Path) -> None:
    """Refuse an entry whose figures do not bound those of its runs, or say little of them."""
    for name, bound in entry["figures"].items():
        run, _, metric = name.rpartition(".")
        found = kept_result(run or entry["run"], folder).metrics[metric]
        if not bound / _LOOSE <= found <= bound:
            raise SystemExit(
                f"gallery.yaml: {entry['run']}: {name} is {found:.6g}, "
                f"not from {bound / _LOOSE:.3g} to {bound:g}"
            )


def _run(folder: Path, name: str) -> str:
    kept_result(name, folder)
    return name


def _play(runs: Path, folder: Path, entry: Mapping[str, Any]) -> str:
    """Write the playback of an entry, whose runs are kept."""
    check_figures(entry, runs)
    result, *beside = (kept_result(name, runs) for name in runs_of(entry))
    return str(write_playback(result, folder / f"{entry['run']}.html", _RATE, beside))


def _film(runs: Path, file: Path, entry: Mapping[str, Any], settings: Mapping[str, Any]) -> None:
    """Write a film of an entry, whose runs are kept."""
    result, *beside = (kept_result(name, runs) for name in runs_of(entry))
    size = {"size": tuple(settings["size"])} if "size" in settings else {}
    print(write_film(result, file, FilmSettings(**{**settings, **size}), beside), flush=True)


def make_pictures(contents: Mapping[str, Any], runs: Path) -> None:
    """Write the pictures of all entries and openings that are given, one after another."""
    PICTURES.mkdir(exist_ok=True)
    for entry in contents["entries"]:
        check_figures(entry, runs)
        settings = {**contents["pictures"], **entry.get("film", {})}
        _film(runs, PICTURES / f"{entry['run']}.webp", entry, settings)
    for opening in contents["openings"]:
        _film(runs, DOCS / opening["file"], opening, opening["film"])


def only(contents: Mapping[str, Any], names: list[str]) -> dict[str, Any]:
    """Return the contents with the entries and openings of some names."""
    kept = {
        **contents,
        "entries": [entry for entry in contents["entries"] if entry["run"] in names],
        "openings": [opening for opening in contents["openings"] if opening["file"] in names],
    }
    found = {each["run"] for each in kept["entries"]} | {each["file"] for each in kept["openings"]}
    if missing := set(names) - found:
        raise SystemExit(f"gallery.yaml: has no entry or opening {', '.join(sorted(missing))}")
    return kept


def make(contents: Mapping[str, Any], folder: Path | None, runs: Path, jobs: int) -> None:
    """Run what is not kept, and write playbacks to a folder if one is given."""
    wanted = {name: None for entry in contents["entries"] for name in runs_of(entry)}
    wanted |= {opening["run"]: None for opening in contents["openings"]}
    # Drake has started threads, which a forked process would not inherit.
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        for name in pool.map(partial(_run, runs), wanted):
            print("run      ", name, file=sys.stderr)
        if folder is None:
            return
        folder.mkdir(parents=True, exist_ok=True)
        for file in pool.map(partial(_play, runs, folder.resolve()), contents["entries"]):
            print("playback ", file, file=sys.stderr)


def main() -> None:
    """Make what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", nargs="?", type=Path, help="folder for the playbacks")
    parser.add_argument("--pictures", action="store_true", help="write the moving pictures")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="runs, or files of the README")
    parser.add_argument("--runs", type=Path, default=RUNS)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    if options.folder is None and not options.pictures:
        parser.error("give a folder for the playbacks, or --pictures")
    contents = only(gallery(), options.only) if options.only else gallery()
    runs = options.runs.resolve()
    runs.mkdir(parents=True, exist_ok=True)
    make(contents, options.folder, runs, options.jobs)
    if options.pictures:
        make_pictures(contents, runs)


if __name__ == "__main__":
    main()
