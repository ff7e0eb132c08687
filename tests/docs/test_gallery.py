"""The gallery: page, list and pictures are in step, and what it says is so."""

import re
import subprocess
import sys

import gallery_page
import make_gallery
import pytest
from doc_pages import ROOT, text_of
from PIL import Image

from drake_rnn import METRICS, FilmSettings, load_experiment, shipped_experiments, simulate
from process_helpers import PATIENCE
from row_helpers import each

CONTENTS = gallery_page.gallery()
ENTRIES, OPENINGS = CONTENTS["entries"], CONTENTS["openings"]
PICTURES = ROOT / "docs" / "gallery"
#: The quickest of the entries.
QUICK = "null_space_adjustment"


def test_the_page_is_what_the_script_makes():
    assert text_of("docs/gallery.md") == gallery_page.page(CONTENTS)


def test_there_are_enough_entries_and_each_has_all_it_should():
    assert 10 <= len(ENTRIES) <= 20
    for entry in ENTRIES:
        assert entry.keys() - {"beside", "film"} == {"run", "title", "says", "figures", "page"}
    for name in ("run", "title", "says"):
        assert len({entry[name] for entry in ENTRIES}) == len(ENTRIES)


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry["run"])
def test_an_entry_names_what_exists(entry):
    assert {entry["run"], *entry.get("beside", [])} <= set(shipped_experiments())
    assert (ROOT / "docs" / entry["page"]).is_file()
    named = set(re.findall(r"\{([\w.]+)\}", entry["says"]))
    assert named == set(entry["figures"])
    assert {name.rpartition(".")[2] for name in named} <= {metric.name for metric in METRICS}
    runs = {name.rpartition(".")[0] for name in named} - {""}
    assert runs <= set(entry.get("beside", []))
    page = text_of("docs/gallery.md")
    assert f"(playbacks/{entry['run']}.html)" in page
    assert re.search(rf"^drake-rnn run {entry['run']}\b", page, re.MULTILINE)


@each("film", [CONTENTS["pictures"], *(each.get("film", {}) for each in [*ENTRIES, *OPENINGS])])
def test_settings_of_films_are_settings(film):
    FilmSettings(**(film | ({"size": tuple(film["size"])} if "size" in film else {})))


def looked_at(file, settings):
    """A picture moves, is as large as it should be, and no larger a file than it may be."""
    with Image.open(file) as picture:
        assert picture.format == "WEBP"
        assert picture.size == tuple(settings["size"])
        # Hardly any was left out for the size of the file.
        assert picture.n_frames >= 20
    assert file.stat().st_size <= settings["most_bytes"]


def test_every_entry_has_its_picture_and_all_together_are_small():
    files = {file.name: file for file in PICTURES.iterdir()}
    assert set(files) == {f"{entry['run']}.webp" for entry in ENTRIES}
    for entry in ENTRIES:
        looked_at(files[f"{entry['run']}.webp"], CONTENTS["pictures"] | entry.get("film", {}))
    assert sum(file.stat().st_size for file in files.values()) < 3e6


@pytest.mark.parametrize("opening", OPENINGS, ids=lambda opening: opening["file"])
def test_the_pictures_that_the_readme_opens_with(opening):
    assert opening["run"] in shipped_experiments()
    looked_at(ROOT / "docs" / opening["file"], opening["film"])
    assert (ROOT / "docs" / opening["file"]).stat().st_size < 1.5e6


# `make docs` makes them as well, which CI does for every commit.
@pytest.mark.nightly
def test_live_playbacks_are_made_and_runs_are_kept(tmp_path):
    runs, folder = tmp_path / "runs", tmp_path / "playbacks"
    options = ["--only", QUICK, "--runs", runs, "--jobs", "1"]
    command = [sys.executable, make_gallery.__file__, folder, *options]
    written = []
    for _ in range(2):
        subprocess.run(command, check=True, capture_output=True, timeout=PATIENCE)
        written.append((runs / QUICK / "result.npz").stat().st_mtime_ns)
        assert [file.name for file in folder.iterdir()] == [f"{QUICK}.html"]
    assert written[0] == written[1]


@pytest.mark.long
def test_a_figure_that_does_not_bound_that_of_the_run_is_refused(tmp_path):
    (entry,) = [entry for entry in ENTRIES if entry["run"] == QUICK]
    result = simulate(load_experiment(QUICK))
    result.save(tmp_path / QUICK)
    make_gallery.check_figures(entry, tmp_path)
    (name,) = entry["figures"]
    found = result.metrics[name]
    for wrong in (0.99 * found, 2.6 * found):
        with pytest.raises(SystemExit, match=f"{QUICK}: {name} is "):
            make_gallery.check_figures(entry | {"figures": {name: wrong}}, tmp_path)
