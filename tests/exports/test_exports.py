"""What other tools read of a result is what the result holds, to the last bit."""

import io
import subprocess
import sys

import numpy as np
import pytest

from drake_rnn import InvalidInputError, load_experiment, simulate
from drake_rnn.exports import FORMATS, export
from drake_rnn.inputs.documents import parse_yaml
from drake_rnn.runs.result import Result


@pytest.fixture(scope="module")
def result():
    return simulate(load_experiment("adaptive_nephroid", {"duration": 0.05, "log_period": 0.01}))


def of_columns(result, name, table):
    """The columns of a series, as the series has them."""
    found = np.stack([table[each] for each in result.columns([name]) if each != "time_s"], axis=-1)
    return found.reshape(result.series[name].shape)


def test_columns_are_named_after_joints_axes_and_units(result):
    columns = result.columns()
    assert next(iter(columns)) == "time_s"
    assert {"position_panda_joint7_rad", "acceleration_panda_joint1_rad_s2"} <= set(columns)
    assert {"p_WE_x_m", "J_3_7_m", "covariance_7_7", "acceleration_peak_rad_s2"} <= set(columns)
    assert np.array_equal(columns["J_2_3_m"], result.series["J"][:, 1, 2])
    assert len(columns) == 1 + sum(x[0].size for x in result.series.values())


@pytest.mark.parametrize("name", ["position", "J_hat", "acceleration_peak"])
def test_tables_are_read_back_to_the_last_bit(result, name, tmp_path):
    pandas, parquet = pytest.importorskip("pandas"), pytest.importorskip("pyarrow.parquet")
    csv = pandas.read_csv(export(result, tmp_path, "csv"), dtype=str).astype(float)
    read = parquet.read_table(export(result, tmp_path, "parquet")).to_pandas()
    assert np.array_equal(result.frame().index, result.time)
    for table in (csv, read, result.frame()):
        assert np.array_equal(of_columns(result, name, table), result.series[name])


def test_parquet_holds_the_document(result, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    told = parquet.read_schema(export(result, tmp_path, "parquet")).metadata[b"experiment"]
    again = load_experiment(parse_yaml(told.decode(), ""))
    assert again.document.to_yaml() == result.experiment.document.to_yaml()


def test_a_recording_is_read_back_to_the_last_bit(result, tmp_path):
    reading = pytest.importorskip("mcap_ros2.reader")
    messages = list(reading.read_ros2_messages(str(export(result, tmp_path, "mcap"))))
    of = {}
    for each in messages:
        of.setdefault(each.channel.topic, []).append(each)
    states = of["/joint_states"]
    assert states[0].ros_msg.name == list(result.experiment.arm.joints)
    for part in ("position", "velocity"):
        found = [list(getattr(each.ros_msg, part)) for each in states]
        assert np.array_equal(found, result.series[part])
    points = [[getattr(each.ros_msg.point, axis) for axis in "xyz"] for each in of["/target"]]
    assert np.array_equal(points, result.series["p_WE_desired"])
    J = [list(each.ros_msg.data) for each in of["/series/J"]]
    assert np.array_equal(np.reshape(J, result.series["J"].shape), result.series["J"])
    dimensions = [(each.size, each.stride) for each in of["/series/J"][0].ros_msg.layout.dim]
    assert dimensions == [(3, 21), (7, 7)]
    assert [each.log_time_ns for each in states] == [round(1e9 * t) for t in result.time]


def test_a_trajectory_is_the_message_that_controllers_take(result, tmp_path):
    message = parse_yaml(export(result, tmp_path, "trajectory").read_text(), "")
    assert message["joint_names"] == list(result.experiment.arm.joints)
    points = message["points"]
    assert points[3]["time_from_start"] == {"sec": 0, "nanosec": 30_000_000}
    found = [each["positions"] for each in points]
    assert np.array_equal(found, result.series["position"])
    assert set(points[0]) == {"positions", "velocities", "accelerations", "time_from_start"}


def test_what_cannot_be_written_is_refused_and_leaves_nothing(result, tmp_path):
    with pytest.raises(InvalidInputError, match=r"series: no 'postion'.*nearest: position"):
        export(result, tmp_path, "csv", ["postion"])
    with pytest.raises(InvalidInputError, match="series: trajectory has the motion of the joints"):
        export(result, tmp_path, "trajectory", ["position"])
    with pytest.raises(InvalidInputError, match="form: no 'xls'; it may be csv"):
        export(result, tmp_path, "xls")
    with pytest.raises(
        InvalidInputError, match=r"form: x\.parquet is named as parquet, not as csv"
    ):
        export(result, tmp_path / "x.parquet")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("form", FORMATS)
def test_a_package_that_is_missing_is_named(result, form, tmp_path, monkeypatch):
    for name in ("pyarrow", "mcap_ros2.writer"):
        monkeypatch.setitem(sys.modules, name, None)
    if form in ("csv", "trajectory"):
        assert export(result, tmp_path, form).exists()
        return
    with pytest.raises(InvalidInputError, match=r"pip install '(pyarrow|mcap)"):
        export(result, tmp_path, form)


@pytest.mark.long
def test_the_command_writes_into_the_folder(result, tmp_path):
    result.save(tmp_path / "run")
    line = [sys.executable, "-m", "drake_rnn", "export", str(tmp_path / "run"), "--series", "p_WE"]
    said = subprocess.run(line, capture_output=True, text=True, check=True).stdout
    assert said.split() == ["series", str(tmp_path / "run" / "series.csv")]
    text = (tmp_path / "run" / "series.csv").read_text()
    assert text.splitlines()[0] == "time_s,p_WE_x_m,p_WE_y_m,p_WE_z_m"
    table = np.loadtxt(io.StringIO(text), delimiter=",", skiprows=1)
    assert np.array_equal(table[:, 1:], Result.load(tmp_path / "run").series["p_WE"])
