"""Make the gallery: the page, its pictures, and live playbacks for the site.

``python docs/make_gallery.py FOLDER`` writes a playback of each entry of docs/gallery.yaml,
``FOLDER/NAME.html``. ``python docs/make_gallery.py --pictures`` writes the page docs/gallery.md and
the moving pictures in docs/gallery/ and of the README; these need what `drake-rnn film` needs.
``--page`` writes the page alone; ``--only NAME`` makes some of them. The runs are kept in
build/gallery_runs until the code changes.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from textwrap import wrap
from typing import Any

from drake_rnn import (
    METRICS,
    FilmSettings,
    Result,
    load_experiment,
    simulate,
    write_film,
    write_playback,
)
from drake_rnn.campaigns.fingerprint import row_key, surroundings
from drake_rnn.experiment import read_document
from drake_rnn.inputs.documents import parse_yaml

DOCS = Path(__file__).parent
PICTURES = DOCS / "gallery"
#: Frame rate of playbacks on the site [1/s], which keeps their files small.
_RATE = 32
#: Share by which a figure may differ from that of the run; two digits are written.
_ROUNDED = 0.06
_UNITS = {metric.name: metric.unit for metric in METRICS}
_PLACEHOLDER = re.compile(r"\{([\w.]+)\}")

_HEAD = """\
# Gallery

<!-- Made by `python docs/make_gallery.py --pictures` from docs/gallery.yaml. -->

Each picture is a [film](python.md#films) of a run, sped up where it says so. The folder of a run
also holds its playback, which can be turned, paused and searched; the links to live playbacks lead
to it on the site, and nowhere else.

```sh
drake-rnn run contact_cat
drake-rnn film out/contact_cat
```
"""


def gallery() -> dict[str, Any]:
    """Return the contents of docs/gallery.yaml."""
    file = DOCS / "gallery.yaml"
    found: dict[str, Any] = parse_yaml(file.read_text(), str(file))
    return found


def runs_of(entry: Mapping[str, Any]) -> list[str]:
    """Return the experiments of an entry, that of its name first."""
    return [entry["run"], *entry.get("beside", [])]


def page(contents: Mapping[str, Any]) -> str:
    """Return the page."""
    return _HEAD + "".join(map(_section, contents["entries"]))


def _section(entry: Mapping[str, Any]) -> str:
    name = entry["run"]
    beside = "".join(f" --beside {other}" for other in entry.get("beside", []))
    sentence = "\n".join(wrap(said(entry), 100, break_long_words=False, break_on_hyphens=False))
    return f"""
## {entry["title"]}

![{entry["title"]}](gallery/{name}.webp)

{sentence}

```sh
drake-rnn run {name}{beside}
```

[Live playback](playbacks/{name}.html) · [the scheme]({entry["page"]})
"""


def said(entry: Mapping[str, Any]) -> str:
    """Return the sentence of an entry with its figures."""
    figures = entry["figures"]

    def written(found: re.Match[str]) -> str:
        name = found[1]
        return _written(figures[name], _UNITS[name.rpartition(".")[2]])

    return _PLACEHOLDER.sub(written, entry["says"])


def _written(value: float, unit: str) -> str:
    """Return a figure with its unit; of lengths and angles, one that suits it."""
    if unit not in ("m", "rad"):
        return f"{value:.2g} {unit}"
    for prefix, factor in (("", 1.0), ("m", 1e3), ("µ", 1e6), ("n", 1e9)):
        if value * factor >= (1.0 if prefix else 10.0) or prefix == "n":
            break
    # 0.37 µm rather than 370 nm; 3.5 nm rather than 0.0035 µm.
    if prefix == "n" and value >= 1e-7:
        prefix, factor = "µ", 1e6
    elif prefix == "µ" and value >= 1e-4:
        prefix, factor = "m", 1e3
    digits = f"{value * factor:.3g}" if value * factor >= 100 else f"{value * factor:.2g}"
    return f"{digits} {prefix}{unit}"


def kept_result(name: str, folder: Path) -> Result:
    """Return the result of an experiment, which is run if no run of it is kept in a folder."""
    document = read_document(name)
    key = row_key(document, surroundings(document), "gallery")
    place, mark = folder / name, folder / name / "gallery_key.txt"
    if mark.is_file() and mark.read_text() == key:
        return Result.load(place)
    mark.unlink(missing_ok=True)
    result = simulate(load_experiment(name))
    result.save(place)
    mark.write_text(key)
    return result


def check_figures(entry: Mapping[str, Any], folder: Path) -> None:
    """Refuse an entry whose figures are not those of its runs."""
    for name, told in entry["figures"].items():
        run, _, metric = name.rpartition(".")
        found = kept_result(run or entry["run"], folder).metrics[metric]
        if abs(found - told) > _ROUNDED * abs(told):
            raise SystemExit(f"gallery.yaml: {entry['run']}: {name} is {found:.3g}, not {told:g}")


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
    parser.add_argument("--page", action="store_true", help="write the page")
    parser.add_argument("--pictures", action="store_true", help="write the page and its pictures")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="runs, or files of the README")
    parser.add_argument("--runs", type=Path, default=DOCS.parent / "build" / "gallery_runs")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    if options.folder is None and not (options.page or options.pictures):
        parser.error("give a folder for the playbacks, --page or --pictures")
    contents = gallery()
    if options.page or options.pictures:
        (DOCS / "gallery.md").write_text(page(contents))
    if options.folder is None and not options.pictures:
        return
    if options.only:
        contents = only(contents, options.only)
    runs = options.runs.resolve()
    runs.mkdir(parents=True, exist_ok=True)
    make(contents, options.folder, runs, options.jobs)
    if options.pictures:
        make_pictures(contents, runs)


if __name__ == "__main__":
    main()
