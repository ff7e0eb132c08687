"""A folder with files that no run has written is refused, at once and in little memory."""

import io
import json
import os
import shutil
import tracemalloc
import zipfile

import numpy as np
import pytest

from drake_rnn import InvalidInputError, Result, load_experiment, simulate

SHORT = {"duration": 0.1, "window": None, "accept": None}
SAMPLES = 11


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Folders of results of two arms; nothing is changed in them."""
    place = tmp_path_factory.mktemp("whole")
    for name in ("pinv_line", "pinv_line_ur5"):
        simulate(load_experiment(name, SHORT)).save(place / name)
    return place


@pytest.fixture
def folder(whole, tmp_path):
    shutil.copytree(whole / "pinv_line", tmp_path / "run")
    return tmp_path / "run"


def refusal(folder):
    """What is said of a folder."""
    with pytest.raises(InvalidInputError) as caught:
        Result.load(folder)
    said = str(caught.value)
    assert "\n" not in said
    return said.removeprefix(f"{folder}: ").removeprefix("holds no result: ")


def head(shape, kind="<f8"):
    """The head of an array, without the array."""
    stream = io.BytesIO()
    told = {"shape": shape, "fortran_order": False, "descr": kind}
    np.lib.format.write_array_header_1_0(stream, told)
    return stream.getvalue()


def write_members(folder, members):
    with zipfile.ZipFile(folder / "result.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (head((10**12, 7)), "position of shape (1000000000000, 7) has 0 bytes"),
        (head((-1, 7)), "position of shape (-1, 7) has 0 bytes"),
        (head((SAMPLES, 7), "|O") + b"\x80\x04N.", "position must hold numbers, not object"),
        (head((SAMPLES, 7), "<U5") + bytes(20 * 77), "position must hold numbers, not <U5"),
        (head((SAMPLES, 7), "<c16") + bytes(16 * 77), "position must hold numbers, not complex128"),
        (head((SAMPLES, 7)) + bytes(8 * 76), "position of shape (11, 7) has 608 bytes"),
        (b"", "EOF: reading magic string"),
        (b"\x93NUMPY\x07\x00", "position is of version (7, 0) of NumPy's format"),
    ],
)
def test_an_array_that_is_none(folder, content, said):
    write_members(folder, {"time": head((SAMPLES,)) + bytes(8 * SAMPLES), "position": content})
    assert said in refusal(folder)


def _changed(folder, change):
    with np.load(folder / "result.npz") as found:
        arrays = dict(found)
    change(arrays)
    np.savez(folder / "result.npz", **arrays)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda a: a.update(position=a["position"][:, 1:]), "position has shape (11, 6), not (11,"),
        (lambda a: a.update(position=a["position"][:, 0]), "position has shape (11,), not (11, 7)"),
        (lambda a: a.update(velocity=a["J"]), "velocity has shape (11, 3, 7), not (11, 7)"),
        (lambda a: a.update(p_WE=a["p_WE"][:, 1:]), "v_WE has shape (11, 3), not (11, 2)"),
        (lambda a: a.update(J=a["J"][:, :, 1:]), "J has shape (11, 3, 6), not (11, 3, 7)"),
        (lambda a: a.pop("p_WE_desired"), "p_WE_desired is missing"),
        (lambda a: a.pop("time"), "time is missing"),
        (lambda a: a.update(time=a["time"][::-1]), "time must be finite numbers that do not fall"),
        (lambda a: a["time"].__setitem__(-1, np.inf), "time must be finite numbers that do not"),
        (lambda a: a["time"].__setitem__(-1, 1e9), "time must be from 0 to 60.2 s, not to 1e+09 s"),
        (lambda a: a["time"].__isub__(5.0), "time must be from 0 to 60.2 s, not to -4.9 s"),
        (
            lambda a: a.update(more=np.zeros((SAMPLES, 200_000))),
            "has more than 100000 numbers",
        ),
    ],
)
def test_series_of_no_such_run(folder, change, said):
    _changed(folder, change)
    assert said in refusal(folder)


def test_an_archive_that_grows_when_it_is_read(folder):
    """A thousand times: 48 MB of zeros are 0.05 MB."""
    rows = 6_000_000
    names = ("position", "velocity", "network_velocity", "p_WE", "v_WE", "J")
    names += ("p_WE_desired", "v_WE_desired")
    small = {name: head((0,)) for name in names}
    write_members(folder, {"time": head((rows,)) + bytes(8 * rows), **small})
    assert (folder / "result.npz").stat().st_size < 60_000
    said = "result.npz has 6000000 samples, and its experiment makes at most 1020"
    tracemalloc.start()
    try:
        assert refusal(folder) == said
        assert tracemalloc.get_traced_memory()[1] < 30e6
    finally:
        tracemalloc.stop()


NAMES = ("run.json", "experiment.yaml", "metrics.json", "result.npz", "diagram.dot")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    "kind", ["pipe", "folder", "device", "loop", "nested", "nested more", "binary", "digits"]
)
def test_what_is_no_file_of_a_run(folder, name, kind):
    file = folder / name
    file.unlink()
    make = {
        "pipe": lambda: os.mkfifo(file),
        "folder": file.mkdir,
        "device": lambda: file.symlink_to("/dev/zero"),
        "loop": lambda: file.symlink_to(file),
        "nested": lambda: file.write_text("[" * 20_000),
        "nested more": lambda: file.write_text('{"a":' * 20_000),
        "digits": lambda: file.write_text(f'{{"a": {"9" * 5000}}}'),
        "binary": lambda: file.write_bytes(bytes(range(256)) * 40),
    }
    make[kind]()
    if name == "diagram.dot" and kind.startswith(("nested", "digits")):
        assert Result.load(folder).graphviz
        return
    said = refusal(folder)
    assert name in said
    assert kind != "digits" or name == "result.npz" or "number of too many digits" in said


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("status", "done", "run.json: status must be one of complete, failed, interrupted"),
        ("status", ["complete"], "run.json: status must be one of complete, failed, interrupted"),
        ("failure", 3, "run.json: failure must be a text"),
        ("warnings", "none", "run.json: warnings must be texts"),
        ("warnings", [1], "run.json: warnings must be texts"),
        ("timings", {"wall_time_s": "long"}, "run.json: timings must be numbers by name"),
        (
            "options",
            {"compiled": "yes"},
            "run.json: options.compiled: must be true or false, not 'yes'",
        ),
        ("options", [], "run.json: options: must be a mapping of keys to values, not []"),
    ],
)
def test_a_record_of_no_run(folder, key, value, said):
    record = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps({**record, key: value}))
    assert refusal(folder) == said


@pytest.mark.parametrize("value", ["1", None, [1], 10**400, {}])
def test_metrics_that_are_no_numbers(folder, value):
    (folder / "metrics.json").write_text(json.dumps({"position_error_max_m": value}))
    assert refusal(folder) == "metrics.json must hold numbers by name"


@pytest.mark.parametrize("name", ["experiment.yaml", "result.npz"])
def test_a_file_of_another_arm(whole, folder, name):
    shutil.copy(whole / "pinv_line_ur5" / name, folder / name)
    assert "result.npz: position has shape (11, " in refusal(folder) or name == "experiment.yaml"


@pytest.mark.long
@pytest.mark.parametrize("name", ["result.npz", "metrics.json", "run.json"])
def test_any_byte(folder, name):
    """That is another one: a result, or a sentence."""
    file = folder / name
    content = file.read_bytes()
    rng = np.random.default_rng(0)
    for _ in range(12):
        damaged = bytearray(content)
        damaged[int(rng.integers(len(content)))] ^= int(rng.integers(1, 256))
        file.write_bytes(damaged)
        try:
            Result.load(folder)
        except InvalidInputError as error:
            assert "\n" not in str(error)  # noqa: PT017  either outcome is right


def test_numbers_of_other_kinds_are_read_as_floats(folder):
    right = Result.load(folder)
    _changed(folder, lambda a: a.update(position=a["position"].astype(">f8")))
    np.testing.assert_array_equal(Result.load(folder).series["position"], right.series["position"])
    _changed(folder, lambda a: a.update(saturated=np.zeros((SAMPLES, 1), dtype=bool)))
    assert Result.load(folder).series["saturated"].dtype == float
