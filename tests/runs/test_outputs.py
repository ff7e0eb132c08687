"""Files that are written: regular ones only, never a result's own, by one process at a time."""

import errno
import os
import socket
import subprocess
import sys
import threading
from dataclasses import replace

import numpy as np
import pytest

from drake_rnn import InvalidInputError, Result, load_experiment, simulate
from drake_rnn.exports import export
from drake_rnn.figures import write_figures
from drake_rnn.playback import write_playback
from drake_rnn.runs import (
    checkpoint,
    result,
)
from drake_rnn.runs import (
    checkpoint as keeper,
)
from drake_rnn.runs import folder as folders
from drake_rnn.runs.folder import (
    claim_folder,
    replacing,
    require_output,
    written_whole,
)
from drake_rnn.tables import Column, Heading, Sheet, write_sheet

SHORT = {"duration": 0.1, "window": None, "accept": None}
KINDS = ("a symbolic link", "a dangling link", "a folder", "a pipe", "a socket", "a device")


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """A result, and its folder."""
    found = simulate(load_experiment("pinv_line", SHORT))
    return found, found.save(tmp_path_factory.mktemp("saved") / "run")


def put(file, kind):
    """Put something that is no regular file in the place of one; return what it is called."""
    file.parent.mkdir(exist_ok=True)
    if kind == "a symbolic link":
        (file.parent / "elsewhere").write_text("kept")
        file.symlink_to(file.parent / "elsewhere")
    elif kind == "a dangling link":
        file.symlink_to(file.parent / "nowhere")
        return "a symbolic link"
    elif kind == "a folder":
        file.mkdir()
    elif kind == "a pipe":
        os.mkfifo(file)
    elif kind == "a socket":
        with socket.socket(socket.AF_UNIX) as server:
            # Its name may not be long.
            before = os.getcwd()
            os.chdir(file.parent)
            server.bind(file.name)
            os.chdir(before)
    else:
        try:
            os.mknod(file, 0o600 | 0o020000, os.makedev(1, 7))
        except PermissionError:
            pytest.skip("only root makes devices")
    return kind


#: What writes a file that a user names, and how the file may be called.
WRITERS = {
    "export csv": ("x.csv", lambda r, f: export(r, f)),
    "export trajectory": ("x.yaml", lambda r, f: export(r, f, "trajectory")),
    "table": ("x.md", lambda r, f: write_sheet(Sheet((Column(Heading("a")),)), f)),
    "playback": ("x.html", lambda r, f: write_playback(r, f)),
    "figure": ("overview.png", lambda r, f: write_figures(r, f.parent, ["overview"])),
    "text": ("x", lambda r, f: written_whole(f).__enter__()),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("writer", WRITERS)
def test_only_a_regular_file_is_written(saved, tmp_path, writer, kind):
    name, write = WRITERS[writer]
    file = tmp_path / "place" / name
    called = put(file, kind)
    before = file.lstat()
    if writer.startswith("export") and kind == "a folder":
        # In which the file is named after the format.
        assert write(saved[0], file).parent == file
        return
    with pytest.raises(InvalidInputError, match=f"{name}: is {called}; only a regular file is wr"):
        write(saved[0], file)
    assert (file.lstat().st_ino, file.lstat().st_mode) == (before.st_ino, before.st_mode)
    kept = tmp_path / "place" / "elsewhere"
    assert not kept.exists() or kept.read_text() == "kept"
    assert not (tmp_path / "place" / "nowhere").exists()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["result.npz", "run.json", "experiment.yaml", "film.gif"])
def test_a_run_does_not_begin_where_its_result_could_not_be_written(tmp_path, name, kind):
    called = put(tmp_path / "run" / name, kind)
    steps = []
    with pytest.raises(InvalidInputError, match=f"{name}: is {called}; only a regular"):
        simulate(load_experiment("pinv_line", SHORT), steps.append, keep=tmp_path / "run")
    assert not steps
    assert os.path.lexists(tmp_path / "run" / name)


@pytest.mark.parametrize("name", ["checkpoint", "figures", "second"])
def test_what_is_elsewhere_is_not_removed_through_a_link(saved, tmp_path, name):
    """A run removes the pictures of the run before it: once those of a user, by such a link."""
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    (pictures / "mine.png").write_text("kept")
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / name).symlink_to(pictures)
    for work in (saved[0].save, lambda folder: simulate(saved[0].experiment, keep=folder)):
        with pytest.raises(InvalidInputError, match=f"{name}: is a symbolic link; a run needs"):
            work(tmp_path / "run")
    assert (pictures / "mine.png").read_text() == "kept"


@pytest.mark.parametrize(
    "name",
    [
        *("run.json", "result.npz", "experiment.yaml", "metrics.json", "diagram.dot", "film.webp"),
        *("playback.html", "figures/overview.png", "checkpoint/steps.bin", "cycles.npz"),
        *("figures/../result.npz", "../run/run.json"),
    ],
)
def test_the_files_of_a_run_are_not_replaced_by_outputs(saved, name):
    folder = saved[1]
    (folder / "figures").mkdir(exist_ok=True)
    before = (folder / "result.npz").read_bytes()
    with pytest.raises(InvalidInputError, match=r"--to: .*: belongs to the results in .*/run"):
        require_output(folder / name, "--to")
    assert (folder / "result.npz").read_bytes() == before
    require_output(folder / "series.csv", "--to")
    require_output(folder.parent / "result.npz", "--to")


@pytest.mark.parametrize(
    ("told", "name"),
    [
        *(("campaign.yaml", each) for each in ("table.csv", "experiment.yaml", "rows/ab/c.json")),
        *(("sweep.csv", "sweep.csv"), ("comparison.csv", "comparison.csv")),
        ("report.json", "index.html"),
    ],
)
def test_nor_are_those_of_other_commands(tmp_path, told, name):
    (tmp_path / told).write_text("")
    with pytest.raises(InvalidInputError, match=r"--table: .*: belongs to the results in"):
        require_output(tmp_path / name, "--table")


@pytest.mark.parametrize("write", ["save", "simulate", "write_figures"])
def test_what_is_the_name_of_no_folder(saved, tmp_path, write):
    result = saved[0]
    call = {
        "save": result.save,
        "simulate": lambda folder: simulate(result.experiment, keep=folder),
        "write_figures": lambda folder: write_figures(result, folder, ["overview"]),
    }[write]
    (tmp_path / "x").touch()
    (tmp_path / "link").symlink_to("nowhere")
    for place, said in {
        "a\0b": "'a.x00b': .*null",
        tmp_path / "x": "x: is a file, not a folder",
        tmp_path / "link": "link: is a file, not a folder",
        3: "must be of class str or Path",
    }.items():
        with pytest.raises(InvalidInputError, match=said):
            call(place)


def test_a_read_only_file_is_not_replaced(tmp_path, monkeypatch):
    (tmp_path / "x").write_text("kept")
    # Root may write to all files.
    monkeypatch.setattr(os, "access", lambda *arguments: False)
    with pytest.raises(InvalidInputError, match="x: is read-only, and is not replaced"):
        written_whole(tmp_path / "x").__enter__()


def test_writers_of_one_file_do_not_disturb_each_other(tmp_path):
    """The file is always one of theirs, whole."""
    file, faults = tmp_path / "x", []

    def write(letter):
        for _ in range(50):
            with replacing(file) as new:
                new.write_text(letter * 10_000)
            if len(set(file.read_text())) != 1 or file.stat().st_size != 10_000:
                faults.append(letter)

    threads = [threading.Thread(target=write, args=(letter,)) for letter in "abcd"]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    assert not faults
    assert os.listdir(tmp_path) == ["x"]


class TestClaims:
    """One process at a time writes to a folder."""

    HOLD = """
import sys
from pathlib import Path
from drake_rnn.runs.folder import claim_folder
with claim_folder(Path(sys.argv[1])):
    print("claimed", flush=True)
    sys.stdin.read()
"""

    @pytest.mark.long
    def test_a_folder_that_another_process_works_in_is_refused(self, saved, tmp_path):
        folder = saved[0].save(tmp_path / "run")
        command = [sys.executable, "-c", self.HOLD, folder]
        pipe = subprocess.PIPE
        with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as other:
            assert other.stdout.readline() == "claimed\n"
            for work in (
                lambda: saved[0].save(folder),
                lambda: simulate(saved[0].experiment, keep=folder),
            ):
                with pytest.raises(InvalidInputError, match="run: another process is working in"):
                    work()
            # Reading does no harm.
            assert Result.load(folder).status == "complete"
            other.kill()
        # Its lock is gone with it, even if it was killed.
        saved[0].save(folder)
        assert not (folder / ".claim").exists()

    def test_those_who_share_it_keep_out_who_does_not(self, tmp_path):
        with claim_folder(tmp_path, is_shared=True):
            with claim_folder(tmp_path, is_shared=True):
                assert (tmp_path / ".claim").exists()
            with pytest.raises(InvalidInputError, match="another process"), claim_folder(tmp_path):
                pass
        with claim_folder(tmp_path):
            pass
        assert not list(tmp_path.iterdir())

    def test_a_thread_works_within_its_own_claim_alone(self, tmp_path):
        said = []

        def other():
            try:
                with claim_folder(tmp_path, within=True):
                    said.append("claimed")
            except InvalidInputError as error:
                said.append(str(error))

        with claim_folder(tmp_path):
            with claim_folder(tmp_path, within=True):
                pass
            thread = threading.Thread(target=other)
            thread.start()
            thread.join()
        assert "another process is working in it" in said[0]

    def test_where_files_cannot_be_locked_work_goes_on(self, tmp_path, monkeypatch):
        def refuse(handle, kind):
            raise OSError(errno.ENOLCK, "no locks")

        monkeypatch.setattr(folders.fcntl, "flock", refuse)
        with claim_folder(tmp_path):
            pass

    @pytest.mark.parametrize("kind", ["a symbolic link", "a pipe", "a folder"])
    def test_a_lock_that_is_no_file_is_refused(self, tmp_path, kind):
        put(tmp_path / ".claim", kind)
        with pytest.raises(InvalidInputError, match=f"is {kind}"), claim_folder(tmp_path):
            pass


class TestFullDisk:
    """What was computed is kept wherever it would fit without a checkpoint."""

    @pytest.fixture
    def stopped(self, saved, tmp_path, monkeypatch):
        """A folder with a checkpoint, and a disk that has room for the result alone."""
        monkeypatch.setattr(keeper, "_EVERY", 0.05)
        monkeypatch.setattr(keeper, "_PAUSE", 0.0)
        folder = tmp_path / "run"
        simulate(saved[0].experiment, keep=folder)
        assert checkpoint.can_go_on(folder)
        return folder

    @staticmethod
    def fill(monkeypatch, folder, room):
        """Let the disk be full while there is a checkpoint; without one there is some room."""

        def write(self, stream):
            if isinstance(stream, result._Counter):
                stream.size = 1000
            elif (folder / checkpoint.FOLDER).exists():
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            else:
                before(self, stream)

        before = Result._write_arrays
        monkeypatch.setattr(Result, "_write_arrays", write)
        monkeypatch.setattr(result, "room_in", lambda place: room)

    def test_the_checkpoint_gives_way_to_the_result(self, saved, stopped, monkeypatch):
        self.fill(monkeypatch, stopped, 1_000_000)
        saved[0].save(stopped)
        assert Result.load(stopped).metrics == saved[0].metrics
        assert not checkpoint.can_go_on(stopped)

    def test_also_to_that_of_an_interrupted_run(self, saved, stopped, monkeypatch):
        self.fill(monkeypatch, stopped, 1_000_000)
        result.stop(replace(saved[0], warnings=[]), "interrupted", "Ctrl-C").save(stopped)
        found = Result.load(stopped)
        assert (found.status, found.warnings) == (
            "interrupted",
            ["checkpoint: removed, to make room for the result"],
        )

    def test_it_stays_where_that_would_not_help(self, saved, stopped, monkeypatch):
        self.fill(monkeypatch, stopped, 0)
        monkeypatch.setattr(result, "size_of", lambda folder: 10)
        with pytest.raises(InvalidInputError) as caught:
            saved[0].save(stopped)
        assert str(caught.value) == (
            f"output folder {stopped}: No space left on device; once it can be written, "
            f"`drake-rnn run --resume {stopped}` makes it from the checkpoint"
        )
        assert checkpoint.can_go_on(stopped)
        assert not (stopped / "result.npz").exists()

    def test_pictures_that_find_no_room_do_not_cost_the_result(self, saved, tmp_path):
        def draw(folder):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        with pytest.raises(OSError, match="No space left"):
            saved[0].save(tmp_path, draw)
        assert Result.load(tmp_path).status == "complete"

    def test_no_checkpoint_takes_the_last_room(self, saved, tmp_path, monkeypatch):
        monkeypatch.setattr(keeper, "_EVERY", 0.05)
        monkeypatch.setattr(keeper, "_PAUSE", 0.0)
        monkeypatch.setattr(keeper, "room_in", lambda folder: keeper._ROOM)
        found = simulate(saved[0].experiment, keep=tmp_path)
        (warning,) = [text for text in found.warnings if text.startswith("checkpoint: ")]
        assert warning.endswith("the disk has too little room for it and the result")
        assert not (tmp_path / checkpoint.FOLDER / checkpoint.STEPS).exists()

    @pytest.mark.skipif(os.geteuid() != 0, reason="only root mounts disks")
    @pytest.mark.long
    @pytest.mark.parametrize(
        "size", ["300k", pytest.param("500k", marks=pytest.mark.nightly), "1M"]
    )
    def test_on_a_small_disk(self, tmp_path, size):
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "none", tmp_path])
        if mounted.returncode:
            pytest.skip("no disk can be mounted here")
        try:
            command = [sys.executable, "-m", "drake_rnn", "run", "slc_nephroid_warm_up"]
            options = ["--duration", "4", "--set", "window=null", "--set", "accept=null"]
            bare = ["--no-figures", "--no-playback", "--out", tmp_path]
            done = subprocess.run([*command, *options, *bare], capture_output=True, text=True)
            assert done.returncode == 0, done.stderr
            found = Result.load(tmp_path / "slc_nephroid_warm_up")
            assert (found.status, found.time[-1]) == ("complete", 4.0)
            assert np.isfinite(found.series["position"]).all()
        finally:
            subprocess.run(["umount", tmp_path], check=True)
