"""The pages of the schemes and the page of choosing one say what the code says."""

import re

import pytest
from doc_pages import ROOT, prose, spans, tables, text_of

from drake_rnn import LAWS, ContactLoss, OnlineStiffness, Secondary, WarmUp, load_experiment
from drake_rnn.claims import SCHEMES, read_claims
from drake_rnn.experiment import parse_change
from drake_rnn.experiment.law import ORIGINS
from drake_rnn.inputs.explained import keys_of
from drake_rnn.laws.law import Reading
from drake_rnn.robot.limits import LIMIT_UNITS

PAGES = sorted(str(file.relative_to(ROOT)) for file in (ROOT / "docs" / "schemes").glob("*.md"))
CHOOSING = "docs/choosing.md"
#: Keys of a law that are sections with keys of their own.
SECTIONS = {
    "contact_loss": ContactLoss,
    "secondary": Secondary,
    "stiffness": OnlineStiffness,
    "warm_up": WarmUp,
}
#: What the cell of a default says where the default is a section, or none that a document gives.
ELSEWHERE = {"secondary": "see below", "measurement": "follows from `sensing`"}
CLAIMS = {claim.id for scheme in SCHEMES for claim in read_claims(scheme).claims}
#: Where each scheme page's section of changes begins from.
_BASE = re.compile(r"changes of\s+`drake-rnn run (\w+)`")
_CHANGE = re.compile(r"(?:law|limits|integrator)\.[\w.]+=\S+")
#: Head of the table of what goes wrong with a key.
WRONG = ["key", "too small", "too large"]
_CLAIM = re.compile(r"(?:slc|jdf|mf|rec|sa)-\w[\w.]*")


def gain_table(kind):
    """Return page and rows of the table of a law's keys; there is one."""
    found = [
        (page, rows)
        for page in PAGES
        for head, rows in tables(page)
        if head[0] == f"key of `{kind}`"
    ]
    assert len(found) == 1, f"{kind} has {len(found)} tables of its keys in docs/schemes/"
    return found[0]


def expected_keys(kind):
    """Return default, as text, by key of a law, with those of its sections; None if needed."""
    found = {}
    for key in keys_of(LAWS[kind], ("kind", *(set(ORIGINS) - {"measurement"}))):
        found[key.name] = ELSEWHERE.get(key.name, key.default)
        if key.name in SECTIONS:
            inner = keys_of(SECTIONS[key.name])
            found |= {f"{key.name}.{part.name}": part.default for part in inner}
    return found


def same_default(cell, default):
    """Return whether a cell names a default: the word, or the same number."""
    if default is None:
        return cell == "must be given"
    try:
        return float(cell) == float(default)
    except ValueError:
        return cell == default


@pytest.mark.parametrize("kind", LAWS)
def test_every_key_of_every_law_is_on_its_page_with_its_default(kind):
    page, rows = gain_table(kind)
    assert LAWS[kind].__module__.rpartition(".")[2] in text_of(page)
    written = {spans(row[0])[0]: row[1] for row in rows}
    expected = expected_keys(kind)
    assert list(written) == list(dict.fromkeys(written))
    assert written.keys() == expected.keys()
    wrong = {k: (written[k], d) for k, d in expected.items() if not same_default(written[k], d)}
    assert not wrong, f"{page}: default written and true: {wrong}"
    assert all(len(row) == 3 and row[2] for row in rows)


@pytest.mark.parametrize("page", PAGES)
def test_every_change_that_goes_wrong_can_be_run(page):
    (base,) = _BASE.findall(prose(page))
    ((_, rows),) = [table for table in tables(page) if table[0] == WRONG]
    gains = [found for head, found in tables(page) if head[0].startswith("key of")]
    keys = {spans(row[0])[0] for found in gains for row in found}
    assert all(len(row) == 3 and spans(row[0])[0] in keys for row in rows)
    for text in [span for row in rows for cell in row[1:] for span in spans(cell)]:
        changes = dict(parse_change(part) for part in text.split() if _CHANGE.fullmatch(part))
        if changes and "--set" not in text:
            load_experiment(base, changes)


@pytest.mark.parametrize("page", PAGES)
def test_a_page_has_its_parts(page):
    titles = re.findall(r"^## (.*)$", prose(page), re.MULTILINE)
    for part in ("Problem and equations", "Symbols", "Gains", "A minimal experiment"):
        assert part in titles, part
    assert any(title.startswith(("Corrected", "What is not as")) for title in titles)
    assert any(title.startswith("What it does not") or "do not do" in title for title in titles)
    assert titles[-1] in ("Paper", "Sources")
    assert "```math\n" in text_of(page)
    assert f"(schemes/{page.rpartition('/')[2]})" in text_of("docs/README.md")


@pytest.mark.parametrize("page", [*PAGES, CHOOSING])
def test_every_claim_that_is_named_exists(page):
    named = {span for span in spans(prose(page)) if _CLAIM.fullmatch(span)}
    assert named <= CLAIMS


# Symbols.


def shapes_of(kind):
    """Return the shapes of state and inputs by name, of all shipped experiments of a law."""
    found, sizes = {}, {}
    for name in LAW_EXPERIMENTS[kind]:
        law = load_experiment(name).law
        readings = [law] if isinstance(law, Reading) and "v" in law.state.parts else []
        for reading in readings:
            for layout in (reading.state, reading.inputs):
                for part, (_, shape) in layout.parts.items():
                    found.setdefault(part, set()).add((shape, law.limits.size, task_size(law)))
        sizes[name] = law.limits.size
    return found


def task_size(law):
    return getattr(law, "task_size", 3)


#: Experiments with one example of each choice that changes a law's signals.
LAW_EXPERIMENTS = {
    "adaptive": ["adaptive_jerk", "adaptive_nephroid", "adaptive_pose"],
    "joint_drift_free": ["naljdf_clover", "moaljdf_parallelogram"],
    "motion_force": ["motion_force_tricuspid", "motion_force_tricuspid_learned"],
    "null_space_adjustment": ["null_space_adjustment"],
    "pseudoinverse": ["stretched_circle", "pinv_waypoints"],
    "receding_horizon": ["horizon_circle"],
    "recursive": ["recursive_circle_printed", "rnn_circle"],
    "simultaneous_learning": ["slc_nephroid_known", "slc_nephroid"],
    "state_adjustment": ["state_adjustment"],
}


@pytest.mark.parametrize("kind", LAWS)
def test_every_symbol_is_a_signal_or_a_key_and_has_its_shape(kind):
    page, _ = gain_table(kind)
    known, keys = shapes_of(kind), set(expected_keys(kind)) | {"period", "limits", "home"}
    keys |= {f"limits.{name}" for name in ("velocity", "acceleration")}
    (symbols,) = [rows for head, rows in tables(page) if head[1:4] == ["here", "unit", "shape"]]
    for _, here, _, shape, meaning in symbols:
        assert meaning
        names = spans(here)
        written = re.findall(r"\([^)]*\)", shape)
        for number, name in enumerate(names):
            if name not in known:
                # What a reading at a period keeps beside the law's own state.
                assert name in keys or name in ("covariance",), name
                continue
            text = written[min(number, len(written) - 1)]
            assert any(fits(text, *found) for found in known[name]), (name, text, known[name])


def fits(text, shape, joints, rows):
    """Return whether a written shape, e.g. (m, n), is this one; other letters fit any size."""
    parts = [part.strip() for part in text.strip("()").split(",") if part.strip()]
    if len(parts) != len(shape):
        return False
    sizes = {"n": joints, "N": joints, "m": rows}
    for part, size in zip(parts, shape, strict=True):
        if part.isdigit() and int(part) != size:
            return False
        if part in sizes and size != sizes[part] and not (part == "n" and "N" in text):
            return False
    return True


# Choosing.


def traits():
    """Return the rows of the table of traits, by the name of their experiment."""
    ((head, rows),) = [table for table in tables(CHOOSING) if "keeps" in table[0]]
    return {spans(row[0])[-1]: dict(zip(head, row, strict=True)) for row in rows}


def span_of(kept):
    """Return names of limits as the page has them: none, one, or the first and the last."""
    order = list(LIMIT_UNITS)
    places = [order.index(name) for name in kept]
    assert places == list(range(places[0], places[0] + len(places))) if places else True
    return " to ".join(dict.fromkeys((kept[0], kept[-1]))) if kept else "none"


@pytest.mark.parametrize("name", traits())
def test_the_traits_of_a_scheme_are_those_of_its_law(name):
    row, experiment = traits()[name], load_experiment(name)
    law, document = experiment.law, experiment.document
    # Noise on top of the law's command is not the law's, a filter behind it is.
    kept = law.keeps if document.filter is None else experiment.kept_limits
    assert row["keeps"] == span_of(kept)
    sees = [signal for signal in ("J", "Jdot_v", "J_omega", "M") if signal in law.inputs.parts]
    if law.joint_preview is not None:
        sees.append("J by its reference")
    assert row["sees"] == (", ".join(sees) or "none")
    sizes = LAWS[law.kind].__dataclass_fields__.get("task_size")
    turns = "R_WE" in law.inputs.parts or (sizes is not None and "6" in str(sizes.type))
    presses = "normal_force" in law.inputs.parts
    assert row["task"] == ("pose, force" if presses else "position, pose" if turns else "position")
    assert row["noise"] == ("yes" if document.dither is not None else "no")
    assert row["joints back"] == pulled_to(law)


def pulled_to(law):
    """Return where a law pulls the joints that its task leaves free, in the words of the page."""
    if hasattr(law, "target"):
        return "to the target"
    weights = [getattr(law, "return_gain", 0.0)]
    if law.kind == "adaptive":
        weights.append(law.secondary.posture)
    if law.kind == "joint_drift_free" and law.scheme != "man":
        weights.append(law.return_weight)
    return "yes" if max(weights) > 0.0 else "no"


def test_every_law_has_its_traits_and_every_scheme_page_is_reached_from_choosing():
    assert {load_experiment(name).law.kind for name in traits()} == set(LAWS)
    for page in PAGES:
        assert page.removeprefix("docs/") in text_of(CHOOSING)
