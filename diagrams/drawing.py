"""A drawing of a diagram's wiring, as text for Graphviz.

Drake's own drawing has a row for each port and a line for each connection, which for a loop in
contact is a page of crossing lines. Here all signals between two systems are one arrow, labelled
with their names, and systems are coloured and shaped by what they do in the loop.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from html import escape
from typing import NamedTuple

from pydrake.systems.framework import Diagram, InputPort, OutputPort, System
from pydrake.systems.primitives import Adder, Integrator, VectorLogSink

from .. import colours
from ..inputs.messages import require_type
from ..systems import Body
from ..systems.block import Block


class _Kind(NamedTuple):
    """What a system does in the loop, and how it is drawn."""

    meaning: str
    shape: str
    fill: str
    line: str


_ROUND = 'box, style="filled,rounded"'
_REFERENCE = _Kind("what is desired", _ROUND, "#B5D9F0", colours.DESIRED)
_LAW = _Kind("law and its state", f"{_ROUND}, penwidth=2.6", "#FFE27A", "#7A6000")
_COMMAND = _Kind("on the way of the command", "box", "#FFFFFF", colours.BOUND)
_BODY = _Kind("what moves", "box3d", colours.ARM, colours.BOUND)
_MODEL = _Kind("computed from the model", "component", "#E6EAEF", "#5F666E")
_SENSOR = _Kind("sensor", "box", "#D093BD", "#8F3B76")
_NOISE = _Kind("noise", "ellipse", "#F0B27A", "#7D4400")
_FORCE = _Kind("force", _ROUND, "#93CFB2", colours.FORCE)
_SURFACE = _Kind("what is pressed on", "note", colours.SURFACE, "#8A7A4A")
_OTHER = _Kind("other", "box", "#FFFFFF", "#5F666E")

_ROLES = {
    "reference": _REFERENCE,
    "law": _LAW,
    "command": _COMMAND,
    "body": _BODY,
    "model": _MODEL,
    "sensor": _SENSOR,
    "noise": _NOISE,
    "force": _FORCE,
}
# Systems that are no blocks; the first that fits.
_KINDS: tuple[tuple[tuple[type, ...], _Kind], ...] = (
    ((Body,), _BODY),
    ((Adder, Integrator), _COMMAND),
)
# Of Drake's blocks some do different things: these are told by their names.
_NAMED = {"normal_force": _FORCE}
#: Characters of a line of a label, at most, if it can be broken.
_WIDTH = 26
#: Entries of the legend in a row.
_ACROSS = 5


def wiring_graph(diagram: Diagram) -> str:
    """Return a drawing of the systems of a diagram and of what flows between them.

    Args:
        diagram: Any diagram, e.g. that of `build_diagram` or one made with `AddLoop`. Logs
            are not drawn.

    Returns:
        Text in the language of Graphviz: ``dot -Tsvg`` makes a picture of it.
    """
    require_type("diagram", diagram, Diagram)
    systems = [each for each in diagram.GetSystems() if not isinstance(each, VectorLogSink)]
    names = {system: f"s{number}" for number, system in enumerate(systems)}
    kinds = {system: _kind(system) for system in systems}
    lines = [_node(names[system], system, kinds[system]) for system in systems]
    for (source, target), signals in _flows(diagram).items():
        label = _signals(signals)
        lines.append(_edge(names[source], names[target], label, kinds[source]))
    drawn = list(kinds.values())
    for system in systems:
        if isinstance(system, Body) and system.contact is not None:
            drawn.append(_SURFACE)
            lines += _touched(names[system], type(system.contact.surface).__name__)
    return _HEAD + "\n".join([*lines, *_legend(drawn)]) + "\n}\n"


_HEAD = """digraph {
  rankdir=TB; nodesep=0.45; ranksep=0.5; bgcolor="white"; pad=0.2;
  fontname="Arial"; labelloc=b;
  node [fontname="Arial", fontsize=13, style=filled, penwidth=1.6, margin="0.16,0.08"];
  edge [fontname="Arial", fontsize=11, penwidth=1.3, arrowsize=0.8];
"""


def _kind(system: System) -> _Kind:
    if named := _NAMED.get(system.get_name()):
        return named
    if isinstance(system, Block):
        return _ROLES.get(system.role, _OTHER)
    for classes, kind in _KINDS:
        if isinstance(system, classes):
            return kind
    return _OTHER


def _node(name: str, system: System, kind: _Kind) -> str:
    title = escape(system.get_name())
    # Drake's templates carry their scalar type.
    what = escape(type(system).__name__.partition("[")[0].rstrip("_"))
    label = f'<b>{title}</b><br/><font point-size="10.5">{what}</font>'
    return f"  {name} [label=<{label}>, {_looks(kind)}];"


def _looks(kind: _Kind) -> str:
    return f'shape={kind.shape}, fillcolor="{kind.fill}", color="{kind.line}"'


def _flows(diagram: Diagram) -> Mapping[tuple[System, System], list[tuple[str, str]]]:
    """Return the names of output and input port of each connection, by the systems joined."""
    found: dict[tuple[System, System], list[tuple[str, str]]] = defaultdict(list)
    for (target, into), (source, out) in diagram.connection_map().items():
        if isinstance(target, VectorLogSink):
            continue
        given: OutputPort = source.get_output_port(out)
        taken: InputPort = target.get_input_port(into)
        found[source, target].append((given.get_name(), taken.get_name()))
    return found


def _signals(ports: Iterable[tuple[str, str]]) -> list[str]:
    """Return the lines that name the signals of an arrow."""
    # A port that has only a number is named by what it is joined to.
    named = dict.fromkeys(
        taken if given in _NUMBERED and taken not in _NUMBERED else given for given, taken in ports
    )
    lines: list[str] = []
    for name in (name for name in named if name not in _NUMBERED):
        if lines and len(lines[-1]) + len(name) + 2 <= _WIDTH:
            lines[-1] += f", {name}"
        else:
            lines.append(name)
    return lines


_NUMBERED = {f"{letter}{number}" for letter in "uy" for number in range(10)} | {"sum"}


def _edge(source: str, target: str, lines: Iterable[str], kind: _Kind) -> str:
    label = "<br/>".join(escape(line) for line in lines)
    # The space keeps the text off its line.
    text = f'label=<<table border="0"><tr><td>{label}</td></tr></table>>, ' if label else ""
    return f'  {source} -> {target} [{text}color="{kind.line}", fontcolor="{kind.line}"];'


def _touched(body: str, surface: str) -> list[str]:
    name = f"{body}_surface"
    return [
        f"  {name} [label=<<b>{escape(surface)}</b>>, {_looks(_SURFACE)}];",
        f'  {body} -> {name} [label="contact", dir=both, style=dashed, color="{_FORCE.line}", '
        f'fontcolor="{_FORCE.line}"];',
    ]


def _legend(drawn: Iterable[_Kind]) -> list[str]:
    """Return a row that says what the colours mean, for the kinds that there are."""
    kinds = list(dict.fromkeys(drawn))
    cells = [
        f'<td bgcolor="{kind.fill}" color="{kind.line}">'
        f'<font point-size="11">{escape(kind.meaning)}</font></td>'
        for kind in kinds
    ]
    rows = [cells[first : first + _ACROSS] for first in range(0, len(cells), _ACROSS)]
    table = "".join(f"<tr>{''.join(row)}</tr>" for row in rows)
    looks = 'border="0" cellborder="1" cellspacing="6" cellpadding="4"'
    return [f"  label=<<table {looks}>{table}</table>>;"]
