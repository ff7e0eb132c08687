"""The drawing of a diagram names its systems and all that flows between them."""

import re
import shutil
import subprocess
from itertools import combinations

import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, Gain

from colour_vision import VISIONS, distance
from drake_rnn import build_diagram, load_experiment, wiring_graph
from drake_rnn.colours import components

NAMES = ("slc_nephroid_known", "contact_circle", "adaptive_smooth", "contact_cat_learned")
_NODE = re.compile(r'(s\d+) \[label=<<b>(\w+)</b>.*fillcolor="(#\w+)"')
_CELL = re.compile(r'<td bgcolor="(#\w+)"')


def edges(graph):
    """Return the words of the labels of the arrows, by the names of the systems joined."""
    names = {node: name for node, name, _ in _NODE.findall(graph)}
    return {
        (names[source], names[target]): set(re.findall(r"\b[a-zA-Z_]\w*", text))
        for source, target, text in re.findall(r"(s\d+) -> (s\d+) \[(.*)\];", graph)
    }


@pytest.mark.parametrize("name", NAMES)
def test_every_connection_is_an_arrow_that_names_its_signal(name):
    diagram, _ = build_diagram(load_experiment(name))
    drawn = edges(wiring_graph(diagram))
    joined = set()
    for (target, into), (source, out) in diagram.connection_map().items():
        pair = (source.get_name(), target.get_name())
        joined.add(pair)
        ports = {source.get_output_port(out).get_name(), target.get_input_port(into).get_name()}
        # Blocks of Drake's have ports with numbers only.
        numbered = all(re.fullmatch(r"[uy]\d|sum", port) for port in ports)
        assert numbered or ports & drawn[pair], (pair, ports)
    assert drawn.keys() == joined


def test_a_law_that_learns_is_seen_not_to_get_the_jacobian():
    known, learned = (
        edges(wiring_graph(build_diagram(load_experiment(name))[0]))["kinematics", "controller"]
        for name in ("slc_nephroid_known", "slc_nephroid_warm_up")
    )
    assert "J" in known
    assert "J" not in learned


def test_a_contact_shows_what_is_pressed_on():
    graph = wiring_graph(build_diagram(load_experiment("contact_circle"))[0])
    assert "<b>Plate</b>" in graph
    assert "what is pressed on" in graph
    assert "noise" not in graph


def test_any_diagram_can_be_drawn():
    builder = DiagramBuilder()
    source = builder.AddNamedSystem("from <here>", ConstantVectorSource([1.0]))
    gain = builder.AddNamedSystem("gain", Gain(2.0, 1))
    builder.Connect(source.get_output_port(), gain.get_input_port())
    graph = wiring_graph(builder.Build())
    assert "from &lt;here&gt;" in graph
    assert "s0 -> s1" in graph


@pytest.mark.skipif(shutil.which("dot") is None, reason="needs Graphviz")
@pytest.mark.parametrize("name", NAMES)
def test_graphviz_draws_it_without_a_complaint(name):
    graph = wiring_graph(build_diagram(load_experiment(name))[0])
    drawn = subprocess.run(
        ["dot", "-Tsvg"], input=graph, capture_output=True, text=True, check=True
    )
    assert drawn.stderr == ""
    assert "controller" in drawn.stdout


@pytest.mark.parametrize("vision", VISIONS)
def test_kinds_of_systems_are_told_apart_by_their_colours(vision):
    """2.3 is just noticed; the class of each system is written in it as well."""
    graph = wiring_graph(build_diagram(load_experiment("contact_cat_learned"))[0])
    fills = _CELL.findall(graph)
    assert len(fills) == 9
    for one, other in combinations(fills, 2):
        assert distance(components(one), components(other), vision) > 7.0, (one, other)
