"""Pages that compare, of libraries and of networks: what is said is what their tables say."""

import re

import pytest
from doc_pages import text_of

from drake_rnn import InvalidInputError, load_experiment

PAGE = "docs/peers.md"
# What is given to a comparison, not measured, is not looked for in a table.
GIVEN = re.compile(r"0\.0[58] m/s²|\b20 rad/s³|1e-\d+|of 20000 samples|of 100 random")


class Tables:
    """The cells of a page's tables, by section and by name of the scheme."""

    def __init__(self, text):
        self._rows = {}
        for section in re.split(r"^###? ", text, flags=re.MULTILINE):
            lines = [line for line in section.splitlines() if line.startswith("| ")]
            cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
            for row in cells[1:]:
                found = dict(zip(cells[0], row, strict=True))
                self._rows[section.splitlines()[0], row[0]] = found

    def cell(self, section, scheme, column):
        (value,) = (v for k, v in self._rows[section, scheme].items() if k.startswith(column))
        return value

    def error(self, scheme, section="Position"):
        """The largest error [um]."""
        return float(self.cell(section, scheme, "error").split(" / ")[0])

    def turned(self, scheme, section):
        return float(self.cell(section, scheme, "orientation"))

    def settled(self, scheme, section="Position"):
        return self.cell(section, scheme, "settles")

    def cost(self, scheme):
        """The cost of a step, and that of the diagram, [u]."""
        return [float(x) for x in re.findall(r"[\d.]+", self.cell("Position", scheme, "u a step"))]

    def most(self, scheme, column):
        return self.cell("Position", scheme, column)


def two(value):
    """Two digits, as in the tables."""
    return f"{float(f'{value:.2g}'):g}"


@pytest.fixture(scope="module")
def tables():
    return Tables(text_of(PAGE))


@pytest.fixture(scope="module")
def summary():
    (found,) = re.findall(r"^## In short\n(.*?)^## ", text_of(PAGE), re.DOTALL | re.MULTILINE)
    return " ".join(re.sub(r"\]\([^)]*\)", "", found).replace("[", "").split())


PLACO, PINK, MINK = "placo, midpoint", "pink, midpoint", "mink, own limit, midpoint"
DRAKE, OURS = "Drake, function, bounded", "ours: adaptive, J known"
LEARNED, JERK = "ours: adaptive, J unknown", "ours: adaptive, jerk"
KLIMITS, RUCKIG = "klimits behind placo, midpoint", "Ruckig behind placo, midpoint"
HELD, POSED = "Orientation held", "ours: adaptive, pose"


def with_jerk_and_learned():
    """Median and worst error of the adaptive law's own page, jerk bounded and J learned [um]."""
    (cells,) = re.findall(
        r"^\| 20 \| learned, 100 seeds: median / worst \| \S+ \| (\S+) / (\S+) \|",
        text_of("docs/schemes/adaptive.md"),
        re.MULTILINE,
    )
    return [f"{float(cell):.0f}" for cell in cells]


def stated(t):
    """Return the clauses with numbers that the tables make."""

    def nm(*schemes):
        (value,) = {two(1e3 * t.error(scheme)) for scheme in schemes}
        return f"{value} nm"

    def times(scheme, which=0):
        return f"{t.cost(scheme)[which] / t.cost(PLACO)[0]:.1f} times"

    def cone(scheme):
        return f"{nm_on_cone(scheme)} and {two(1e3 * t.turned(scheme, 'Cone'))} nrad"

    def nm_on_cone(scheme):
        return f"{two(1e3 * t.error(scheme, 'Cone'))} nm"

    def held(scheme):
        return [
            f"{1e-3 * t.error(scheme, HELD):.1f}",
            two(1e-3 * t.turned(scheme, HELD)),
            t.settled(scheme, HELD),
        ]

    def turned_round(scheme):
        return t.cell("Into walls", scheme, "reversals")

    assert cone(PLACO) == cone(POSED)
    assert t.most(PLACO, "jerk") == t.most(OURS, "jerk") == t.most(PINK, "jerk")
    assert (t.most(PLACO, "a / bound"), t.most(PLACO, "failures")) == ("1", "0")
    ours, klimits, ruckig = (held(s) for s in (f"{POSED}, jerk", KLIMITS, RUCKIG))
    assert klimits[2] == ruckig[2]
    assert {t.most(s, "jerk") for s in (JERK, KLIMITS, RUCKIG)} == {"20"}
    default = "Drake, function, bounded, default tolerance"
    median, worst = with_jerk_and_learned()
    return [
        f"placo, pink and mink are {nm(PLACO, PINK, MINK)} off, OInK {nm('OInK, midpoint')} and our"
        f" adaptive law {nm(OURS)}.",
        f"placo and OInK are {nm('placo', 'OInK')} off",
        f"a twist, {nm('pink', 'mink')}.",
        f"is {nm(DRAKE)} off without the midpoint and {nm(f'{DRAKE}, midpoint')} with it",
        f"with the midpoint {t.cost(PLACO)[0]} u, all bounds kept, no failure",
        f"takes {times(OURS)} as long, our diagram {times(OURS, 1)},"
        f" OInK {times('OInK, midpoint')}, mink {times(MINK)} and pink {times(PINK)}.",
        f"placo takes {t.settled(PLACO)} s, our law {t.settled(OURS)} s with J known and"
        f" {t.settled(LEARNED)} s with J learned",
        f"placo takes {t.settled(f'{PLACO}, braking 0.08')} s, our law with J learned"
        f" {t.settled(f'{LEARNED}, braking 0.08')} s.",
        f"{two(1e3 * t.error(KLIMITS))} and {nm(RUCKIG)} off within 20 rad/s³, at"
        f" {t.cost(KLIMITS)[0]} and {t.cost(RUCKIG)[0]} u; our law {nm(JERK)} at"
        f" {t.cost(JERK)[0]} u.",
        f"is {ours[0]} mm and {ours[1]} mrad off and back after {ours[2]} s",
        f"{klimits[0]} and {ruckig[0]} mm, {klimits[1]} and {ruckig[1]} mrad and {ruckig[2]} s.",
        f"it is {t.most(OURS, 'jerk')} rad/s³, with the peers and with our law",
        f"Without J it is {t.error(LEARNED):.2f} µm off, or"
        f" {t.error(f'{LEARNED}, braking 0.08'):.2f} µm at 0.08 m/s²",
        f"on the cone {two(t.error(f'{POSED}, J unknown', 'Cone'))} µm and"
        f" {two(t.turned(f'{POSED}, J unknown', 'Cone'))} µrad",
        f"within 20 rad/s³ our law is {median} µm off (median of 100 random initial J), at worst"
        f" {worst}",
        f"exceed the bound {t.most('pink, default tolerance', 'a / bound')} times",
        f"Drake's function {t.most(default, 'a / bound')} times, after which"
        f" {t.most(default, 'failures')} of 20000 samples",
        f"round {turned_round('mink')} times a second,"
        f" ours {turned_round('ours: adaptive')} times.",
        f"miss the path by {two(1e-3 * t.error('OInK, default tolerance'))} mm",
    ]


def test_every_number_of_the_summary_is_that_of_the_tables(tables, summary):
    left = summary
    for clause in stated(tables):
        assert clause in left, clause
        left = left.replace(clause, "", 1)
    assert not re.findall(r".{0,20}\d.{0,20}", GIVEN.sub("", left))


def test_what_the_summary_says_of_all_three_is_so(tables, summary):
    """No row learns J within a bound on jerk; those that learn keep their bound on acceleration."""
    for scheme in (LEARNED, f"{LEARNED}, braking 0.08"):
        assert float(tables.most(scheme, "jerk")) > 1000.0
        assert tables.most(scheme, "a / bound") == "1"
    cone = f"{POSED}, J unknown"
    assert float(tables.cell("Cone", cone, "jerk")) > 1000.0
    assert tables.cell("Cone", cone, "a / bound") == "1"
    assert "No row here has all three." in summary
    assert "all three at once" not in text_of(PAGE)


def test_the_midpoint_is_more_precise_with_every_library_and_costs_more(tables):
    for before, after in (
        ("placo", PLACO),
        ("pink", PINK),
        ("mink, own limit", MINK),
        ("OInK", "OInK, midpoint"),
        (DRAKE, f"{DRAKE}, midpoint"),
        ("Drake, system", "Drake, system, midpoint"),
    ):
        assert tables.error(after) < 0.1 * tables.error(before)
        assert tables.cost(after)[0] > tables.cost(before)[0]


EVIDENCE = "docs/evidence.md"
DISTURBED = ("constant", "ramp", "random")


def network_tables():
    """The tables of networks on their page, by command: cells by network and column."""
    found = {}
    for command, head, rows in re.findall(
        r"^<!-- made by (python benchmarks/networks_compared\.py.*?); of \w+ -->\n"
        r"(\|.*)\n\|[-|]+\|\n((?:\|.*\n)+)",
        text_of(EVIDENCE),
        re.MULTILINE,
    ):
        names = [cell.strip() for cell in head.strip("|").split("|")]
        lines = [[c.strip() for c in row.strip("|").split("|")] for row in rows.splitlines()]
        found[command.partition(".py")[2].strip()] = {
            line[0]: dict(zip(names, line, strict=True)) for line in lines
        }
    return found


WIDE = "--folder out/campaign_networks_wide"


def words_below(title):
    """The prose of a section on networks, without its table."""
    (found,) = re.findall(rf"^### {title}\n(.*?)^### ", text_of(EVIDENCE), re.DOTALL | re.MULTILINE)
    found = re.sub(r"^(?:\||<!--).*$", "", found, flags=re.MULTILINE)
    return " ".join(re.sub(r"\]\([^)]*\)", "", found).replace("[", "").split())


def stated_of_networks(tables):
    """Return the clauses with numbers that the tables of networks make."""
    one, each = tables[""], tables["--each"]
    slc, ours = one["slc, J known"], one["adaptive, known J"]
    tolerant, lvi = one["zeroing, linear, integral gain 50"], one["projection, lvi"]
    fixed, pinv = one["zeroing, fixed time"], one["pseudoinverse"]
    behind, shakes = one["recursive, n = 1"], "shakes, `measured` [rad/s^2]"
    near = [
        float(row["constant"]) for name, row in one.items() if not re.search("power$|recurs", name)
    ]
    four = each["zeroing, linear, four step"]["measured"]
    assert each["zeroing, linear, taylor"]["measured"] == four
    for kind in ("constant", "ramp"):
        assert pinv[kind] == min((row[kind] for row in one.values()), key=float)
    pairs = [(slc[kind], ours[kind]) for kind in ("constant", "ramp", "random", "none", "measured")]
    return [
        f"errors are {min(near)} to {max(near)} mm under a constant disturbance",
        f"`power` leaves {one['zeroing, power']['constant']} mm",
        f"follows {behind['none']} mm behind, and fails in {behind['failed']} runs",
        f"are within {four} mm of their path",
        f"the adaptive law within {each['adaptive, known J']['measured']}, and `lvi` within"
        f" {each['projection, lvi']['measured']}",
        f"it is {tolerant['constant']} and {tolerant['ramp']} mm off, where the nearest, the"
        f" pseudoinverse, is {pinv['constant']} and {pinv['ramp']}; with noise"
        f" {tolerant['measured']}",
        f"asks for {tolerant[shakes]} rad/s², `lvi` for {lvi[shakes]}, `fixed_time` for"
        f" {fixed[shakes]}, the pseudoinverse for {pinv[shakes]}",
        "constant ({} against {} mm), ramp ({}, {}) and random ({}, {}), and farther without a"
        " disturbance ({} against {} mm) and with noise ({}, {})".format(*sum(pairs, ())),
        f"asks for {one['projection, J learned'][shakes]} rad/s²",
        f"from {one['zeroing, linear'][shakes]} rad/s², linear, to {fixed[shakes]}, `fixed_time`",
    ]


def test_the_advice_on_networks_is_what_their_tables_say():
    left = words_below("Which one to take")
    for clause in stated_of_networks(network_tables()):
        assert clause in left, clause
        left = left.replace(clause, "", 1)
    given = r"500 Hz|With 80/s|gain: 200|integral_gain: 50|feedback: 80|where 0\.1 mm is measured"
    assert not re.findall(r".{0,20}\d.{0,20}", re.sub(given, "", left))


def test_an_activation_other_than_power_changes_an_error_by_less_than_a_third():
    table = network_tables()[""]
    for name in ("bipolar sigmoid", "power sigmoid", "hyperbolic sine", "power sum", "fixed time"):
        for kind in DISTURBED:
            error, linear = (float(table[f"zeroing, {n}"][kind]) for n in (name, "linear"))
            assert 2.0 / 3.0 * linear < error <= linear


def test_laws_said_to_keep_bounds_do_and_slc_is_nearer_under_disturbances():
    table = network_tables()[""]
    assert {"position", "velocity", "acceleration"} <= {*load_experiment("slc_nephroid").law.keeps}
    for kind in (*DISTURBED, "none", "measured"):
        slc, ours = (float(table[n][kind]) for n in ("slc, J known", "adaptive, known J"))
        assert (slc < ours) == (kind in DISTURBED)


def test_what_is_said_of_larger_gains_is_what_their_table_says():
    one, wide = (network_tables()[command] for command in ("", WIDE))
    shakes, linear = "shakes, `measured` [rad/s^2]", "zeroing, linear"
    before, after = one[linear], wide[linear]
    text = words_below("With larger gains")
    for clause in (
        f"{after['constant']} mm in place of {before['constant']} under a constant",
        f"{after['measured']} in place of {before['measured']} with noise",
        f"asks for {after[shakes]} rad/s² in place of {before[shakes]}",
        f"`slc` fails in {wide['slc, J known']['failed']} runs",
    ):
        assert clause in text, clause
    largest = {name for name, row in wide.items() if ": 480`" in row["settings"]}
    assert set(wide) - largest == {"zeroing, linear, four step", "slc, J known"}
    alike = (linear, "zeroing, fixed time", f"{linear}, integral gain 50", "projection, lvi")
    for column in (*DISTURBED, "measured"):
        assert len({wide[name][column] for name in alike}) == 1
    nearest = ("adaptive, known J", "pseudoinverse")
    for kind in ("constant", "ramp"):
        least = min((row[kind] for row in wide.values()), key=float)
        assert {wide[name][kind] for name in nearest} == {least}
    ours, pinv = (wide[name] for name in nearest)
    for kind in ("none", "constant", "ramp"):
        assert float(ours[kind]) < float(wide["slc, J known"][kind])
    assert f"{ours['constant']} and {ours['ramp']} mm: the law within {ours[shakes]} rad/s²" in text
    assert f"the pseudoinverse with {pinv[shakes]}" in text


def test_feedback_is_varied_up_to_what_a_law_accepts():
    """480 /s runs at 2 ms; more than 500 /s, which is 1 / period, is refused."""
    limits = {"velocity": 1.5, "acceleration": 15.0}
    for kind, key in (("zeroing", "feedback"), ("projection", "feedback"), ("adaptive", "kappa")):
        document = {"law": {"kind": kind, key: 480.0}, "period": 2e-3, "accept": None}
        load_experiment("zeroing_noise", document | {"limits": limits})
        document["law"][key] = 501.0
        with pytest.raises(InvalidInputError, match=rf"law\.{key}"):
            load_experiment("zeroing_noise", document | {"limits": limits})
