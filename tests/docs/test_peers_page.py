"""Pages that compare, of libraries and of networks: what is said is what their tables say."""

import re
from itertools import product

import numpy as np
import pytest
from doc_pages import text_of

from drake_rnn import InvalidInputError, load_experiment
from drake_rnn.jobs import read_campaign

PAGE = "docs/peers.md"
# What is given to a comparison, not measured, is not looked for in a table.
GIVEN = re.compile(r"0\.0[58] m/s²|\b20 rad/s³|1e-\d+|of 20000 samples|of 100 random|1000 robots")


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

    def schemes(self, section):
        """The names of a section's rows, without the rule below the head."""
        return [scheme for of, scheme in self._rows if of == section and scheme.strip("-")]

    def cell(self, section, scheme, column):
        (value,) = (v for k, v in self._rows[section, scheme].items() if k.startswith(column))
        return value

    def error(self, scheme, section="Position"):
        """The largest error [um]."""
        return float(self.cell(section, scheme, "error").split(" / ")[0])

    def errors(self, section, scheme):
        """All errors that are given in nm or nrad."""
        row = self._rows[section, scheme]
        return [float(v) for k, v in row.items() if k.endswith(("[nm]", "[nrad]"))]

    def turned(self, scheme, section):
        return float(self.cell(section, scheme, "orientation"))

    def settled(self, scheme, section="Position"):
        return self.cell(section, scheme, "settles")

    def cost(self, scheme, section="Position"):
        """The cost of a step, and that of the diagram, [u]; as they are written."""
        return re.findall(r"[\d.]+", self.cell(section, scheme, "u a step"))

    def step(self, scheme, section="Position"):
        """The cost of a step [u]."""
        return float(self.cost(scheme, section)[0])

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
OINK, EMBODIK = "OInK, midpoint", "EmbodiK, midpoint"
FREE, BY_DEFAULT = "EmbodiK, no posture, midpoint", "EmbodiK, no posture, default tolerance"
IN_C = ", in C"
HELD, POSED = "Orientation held", "ours: adaptive, pose"


#: Of the most precise peers with all bounds, by what a step costs.
RANKED = (FREE, PLACO, EMBODIK, OINK, MINK, PINK)


def with_jerk_and_learned():
    """Median and worst error of the adaptive law's own page, jerk bounded and J learned [um]."""
    (cells,) = re.findall(
        r"^\| 20 \| learned, 100 seeds: median / worst \| \S+ \| (\S+) / (\S+) \|",
        text_of("docs/schemes/adaptive.md"),
        re.MULTILINE,
    )
    return [f"{float(cell):.0f}" for cell in cells]


def of_further_tasks(t):
    """Return what is said; all but placo's axis task are below 1 of each at the midpoint."""
    sections = ("A mobile base", "An axis", "A remote centre of motion", "Two tools")
    own, axis = ("ours: adaptive", f"ours: adaptive{IN_C}"), "placo, axis task, midpoint"
    for section in sections:
        schemes = {name for name in t.schemes(section) if name.endswith(", midpoint")} | {*own}
        errors = [cell for name in schemes - {axis} for cell in t.errors(section, name)]
        assert max(errors) < 1.0
    steps, in_c = ([t.cost(name, section)[0] for section in sections] for name in own)
    least, most = (pick(in_c, key=float) for pick in (min, max))
    return (
        f"within 1 nm and 1 nrad, but {t.cell('An axis', axis, 'axis')} nrad by placo's task of an "
        f"axis. Ours costs {least} to {most} u in C, {min(steps, key=float)} to "
        f"{max(steps, key=float)} u in NumPy."
    )


def stated(t):
    """Return the clauses with numbers that the tables make."""

    def nm(*schemes):
        (value,) = {two(1e3 * t.error(scheme)) for scheme in schemes}
        return f"{value} nm"

    def costs(*schemes):
        found = [f"{name} {t.cost(scheme)[0]} u" for name, scheme in schemes]
        return f"{', '.join(found[:-1])} and {found[-1]}"

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
    for scheme in (f"{OURS}{IN_C}", OURS, PLACO, FREE, EMBODIK):
        assert (t.most(scheme, "a / bound"), t.most(scheme, "failures")) == ("1", "0")
    assert t.most(BY_DEFAULT, "a / bound") == "1"
    ours, klimits, ruckig = (held(s) for s in (f"{POSED}, jerk", KLIMITS, RUCKIG))
    assert klimits[2] == ruckig[2]
    assert {t.most(s, "jerk") for s in (JERK, KLIMITS, RUCKIG)} == {"20"}
    default = "Drake, function, bounded, default tolerance"
    median, worst = with_jerk_and_learned()
    in_c = t.cost(f"{OURS}{IN_C}")
    return [
        f"placo, pink and mink are {nm(PLACO, PINK, MINK)} off, OInK and EmbodiK"
        f" {nm(OINK, EMBODIK)} and our adaptive law {nm(OURS, f'{OURS}{IN_C}')}.",
        f"placo, OInK and EmbodiK are {nm('placo', 'OInK', 'EmbodiK')} off",
        f"a twist, {nm('pink', 'mink')}.",
        f"is {nm(DRAKE)} off without the midpoint and {nm(f'{DRAKE}, midpoint')} with it",
        f"Without that pull EmbodiK is {nm(FREE)} off; its joints drift"
        f" {t.most(FREE, 'drift')} mrad",
        f"{in_c[0]} u with J known, all bounds kept, no failure. In NumPy it takes"
        f" {t.cost(OURS)[0]} u, its diagram {t.cost(OURS)[1]} u, in C {in_c[1]} u.",
        f"EmbodiK without a posture takes {t.cost(FREE)[0]} u, "
        + costs(*zip(("placo", "EmbodiK", "OInK", "mink", "pink"), RANKED[1:], strict=True)),
        f"placo takes {t.settled(PLACO)} s, our law {t.settled(OURS)} s with J known and"
        f" {t.settled(LEARNED)} s with J learned",
        f"placo takes {t.settled(f'{PLACO}, braking 0.08')} s, our law with J learned"
        f" {t.settled(f'{LEARNED}, braking 0.08')} s.",
        f"{two(1e3 * t.error(KLIMITS))} and {nm(RUCKIG)} off within 20 rad/s³, at"
        f" {t.cost(KLIMITS)[0]} and {t.cost(RUCKIG)[0]} u; our law {nm(JERK, f'{JERK}{IN_C}')} at"
        f" {t.cost(JERK)[0]} u, in C {t.cost(f'{JERK}{IN_C}')[0]} u.",
        f"is {ours[0]} mm and {ours[1]} mrad off and back after {ours[2]} s",
        f"{klimits[0]} and {ruckig[0]} mm, {klimits[1]} and {ruckig[1]} mrad and {ruckig[2]} s.",
        f"it is {t.most(OURS, 'jerk')} rad/s³, with the peers and with our law",
        f"Without J it is {t.error(LEARNED):.2f} µm off, or"
        f" {t.error(f'{LEARNED}, braking 0.08'):.2f} µm at 0.08 m/s²",
        f"only rounding differs, {t.error(f'{LEARNED}{IN_C}'):.2f} and"
        f" {t.error(f'{LEARNED}, braking 0.08{IN_C}'):.2f} µm",
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
        f"EmbodiK keeps it, but is {two(1e-3 * t.error(BY_DEFAULT))} mm off",
        of_further_tasks(t),
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


def test_every_law_in_c_costs_less_than_all_peers_and_moves_as_in_numpy(tables):
    """Those that learn J in another way, by rounding alone, within a factor of two."""
    for section, count in (("Position", 9), (HELD, 3), ("Cone", 4)):
        in_c = [s for s in tables.schemes(section) if s.endswith(IN_C)]
        peers = [s for s in tables.schemes(section) if "ours:" not in s]
        assert len(in_c) == count
        least = min(tables.step(scheme, section) for scheme in peers)
        for scheme in in_c:
            numpy = scheme.removesuffix(IN_C)
            assert tables.step(scheme, section) < 2.0 < least
            assert tables.step(scheme, section) < 0.1 * tables.step(numpy, section)
            if "J unknown" in scheme:
                ratio = tables.error(scheme, section) / tables.error(numpy, section)
                assert 0.5 < ratio < 2.0
                continue
            for column in ("error", "settles", "v / bound", "a / bound", "drift", "failures"):
                same = tables.cell(section, numpy, column)
                assert tables.cell(section, scheme, column) == same


def test_peers_are_named_in_the_order_of_their_costs(tables):
    found = [tables.step(scheme) for scheme in RANKED]
    assert found == sorted(found)
    others = {s for s in tables.schemes("Position") if ", midpoint" in s} - set(RANKED)
    assert min(map(tables.step, others)) > tables.step(FREE)
    prioritised = "EmbodiK, prioritised, midpoint"
    assert tables.error(prioritised) > 1e3 * tables.error(EMBODIK)
    assert tables.step(prioritised) > tables.step(EMBODIK)


def test_what_is_said_of_many_robots_is_what_their_table_says(tables, summary):
    assert "on a CPU our law in C is faster than mink-warp, and more precise" in summary
    section = "Many robots"
    theirs = ["mink-warp", "mink-warp, own limit"]
    numpy, jax, in_c = ours = [f"{OURS}{how}" for how in ("", ", JAX", IN_C)]
    assert tables.schemes(section) == [*theirs, *ours]
    for count in ("1 robot:", "100 robots", "1000 robots"):
        rates = {s: float(tables.cell(section, s, count)) for s in (*theirs, *ours)}
        assert rates[in_c] > max(rates[s] for s in theirs)
    # Of 1000 robots.
    assert max(rates[numpy], rates[jax]) < min(rates[s] for s in theirs)
    for scheme in ours:
        assert tables.error(scheme, section) < 0.1 * min(tables.error(s, section) for s in theirs)


def test_what_is_said_of_a_graphics_card_is_what_its_table_says(tables, summary):
    assert "On a graphics card mink-warp is two to five times as fast" in summary
    section, times = "On a graphics card", []
    for count in ("1000", "4000", "16000"):
        mine = float(tables.cell(section, f"{OURS}, JAX", count))
        for peer in ("mink-warp", "mink-warp, own limit"):
            times.append(float(tables.cell(section, peer, count)) / mine)
        assert mine > float(tables.cell(section, f"{OURS}{IN_C}", count))
    assert 2.0 < min(times) < max(times) < 5.0


SCENES = ("Ten balls", "Into itself", "Into walls")


def test_what_is_said_of_obstacles_is_what_their_tables_say(tables):
    def cell(section, scheme, column):
        return tables.cell(section, scheme, column)

    def number(section, scheme, column):
        return float(cell(section, scheme, column).split()[0])

    us, soft, hard, filtered = (
        "ours: adaptive", "placo, soft", "placo", "cbfpy behind placo, accelerations",
    )  # fmt: skip

    def kept(section, scheme):
        """No collision, bounds kept, and a solution for every sample."""
        return cell(section, scheme, "collided")[0] == "0" and bounded(section, scheme)

    def bounded(section, scheme):
        ratio = cell(section, scheme, "a / bound")
        near = re.fullmatch(r"1(?: \+ \de-(?:0[6-9]|1\d))?(?: \(v: 0\.\d+\))?", ratio)
        return near is not None and cell(section, scheme, "samples without") == "0"

    balls, walls, itself = SCENES[0], "Into walls", "Into itself"
    in_c = f"{us}, in C"
    safe = {s for s in tables.schemes(balls) if kept(balls, s)}
    assert safe == {us, in_c, soft, "pink", filtered}
    assert min(safe, key=lambda s: number(balls, s, "reversals")) == "pink"
    assert number(balls, hard, "samples without") > 0
    assert cell(balls, "mink", "samples without") == "568"
    assert number(balls, "OInK", "a / bound") > 1.01
    costs = [number(section, in_c, "u a step") for section in (*SCENES, "Nothing near")]
    assert (min(costs), max(costs)) == (2, 14)
    for section in SCENES:
        assert cell(section, "mink", "collided")[0] == "0"
        avoiding = {s for s in tables.schemes(section) if "bounds only" not in s}
        assert min(avoiding, key=lambda s: number(section, s, "u a step")) == in_c
        for cheaper in (hard, soft, "mink"):
            assert number(section, cheaper, "u a step") < number(section, us, "u a step")
    bounds = [s for s in tables.schemes(walls) if bounded(walls, s)]
    most = sorted(bounds, key=lambda s: number(walls, s, "reversals"))[-2:]
    assert set(most) == {us, in_c}
    assert {number(walls, s, "reversals") for s in most} == {66}
    assert cell(walls, "mink", "reversals") == "3"
    assert cell(itself, "pink", "samples without") == "500"
    assert cell(itself, hard, "samples without") == "4021"
    always = [s for s in tables.schemes(balls) if all(kept(each, s) for each in SCENES)]
    assert always == [us, in_c]


def test_the_midpoint_is_more_precise_with_every_library_and_costs_more(tables):
    for before, after in (
        ("placo", PLACO),
        ("pink", PINK),
        ("mink, own limit", MINK),
        ("OInK", OINK),
        ("EmbodiK", EMBODIK),
        ("EmbodiK, no posture", FREE),
        (DRAKE, f"{DRAKE}, midpoint"),
        ("Drake, system", "Drake, system, midpoint"),
    ):
        assert tables.error(after) < 0.1 * tables.error(before)
        assert tables.step(after) > tables.step(before)


EVIDENCE = "docs/evidence.md"
SHAKES = "shakes, `measured` [rad/s^2]"
DISTURBED = ("constant", "ramp", "random")
EVERY = ("none", *DISTURBED, "measured")
RATES = (250, 500, 1000)


def network_tables():
    """The tables of networks on their page, by campaign: cells by first cell and column."""
    found = {}
    for command, head, rows in re.findall(
        r"^<!-- made by python benchmarks/networks_compared\.py (.*?); of \w+"
        r"(?:; measured before .*?)? -->\n"
        r"(\|.*)\n\|[-|]+\|\n((?:\|.*\n)+)",
        text_of(EVIDENCE),
        re.MULTILINE,
    ):
        names = [cell.strip() for cell in head.strip("|").split("|")]
        lines = [[c.strip() for c in row.strip("|").split("|")] for row in rows.splitlines()]
        found[command] = {line[0]: dict(zip(names, line, strict=True)) for line in lines}
    return found


@pytest.fixture(scope="module")
def networks():
    """The tables of networks by frequency [Hz], and that of less feedback."""
    found = network_tables()
    less = found.pop('networks_500_hz --feedback-of "zeroing, linear"')
    assert sorted(found) == sorted(f"networks_{rate}_hz" for rate in RATES)
    return {rate: found[f"networks_{rate}_hz"] for rate in RATES} | {"feedback": less}


def chosen_gains(row):
    """Of a row of a table: the gains chosen, and where each of them is in its grid."""
    gains = {k: float(v) for k, v in re.findall(r"`(\w+): \[?([^\]`]+)\]?`", row["settings"])}
    places = dict(re.findall(r"`(\w+)` ([^,]+)", row["in its grid"]))
    if row["in its grid"] == "inside":
        places = dict.fromkeys(gains, "inside")
    assert places.keys() == gains.keys()
    return {key: (value, places[key]) for key, value in gains.items()}


def settings_of(rate):
    """The gains that a campaign varies, of each network in the order of its table."""
    found = {}
    for grid in read_campaign(f"networks_{rate}_hz").vary["law"]["of"]:
        lists = [np.ravel(values).tolist() for values in grid["over"].values()]
        settings = [dict(zip(grid["over"], values, strict=True)) for values in product(*lists)]
        found.setdefault(str(grid["fixed"]), []).extend(settings)
    return list(found.values())


@pytest.mark.parametrize("rate", RATES)
def test_the_grid_of_every_network_has_its_optimum(networks, rate):
    """Chosen gains have smaller and larger ones beside them, have saturated, or are the largest."""
    largest = {"feedback": rate, "kappa": rate, "gain": 1e9}
    assert len(networks[rate]) == 24
    for row, settings in zip(networks[rate].values(), settings_of(rate), strict=True):
        gains = chosen_gains(row)
        for key, (value, place) in gains.items():
            others = {k: v for k, (v, _) in gains.items() if k != key}
            tried = [each[key] for each in settings if others.items() <= each.items()]
            assert value in tried
            assert len(tried) >= 2
            assert (min(tried) < value < max(tried)) == (place == "inside")
            if place == "limit":
                assert 0.98 * largest[key] <= value <= largest[key]
            elif place != "inside":
                assert key in {"gain", "rate", "damping", "iterations", "limit_stiffness"}
                assert 0.0 <= float(place.removesuffix(" %")) < 1.0


def test_the_feedback_chosen_is_the_limit_but_for_three_networks(networks):
    inside = {
        name
        for name, row in networks[500].items()
        for key, (_, place) in chosen_gains(row).items()
        if key in {"feedback", "kappa"} and place == "inside"
    }
    assert inside == {TAYLOR, FOUR_STEP, SLC}


def words_below(title):
    """The prose of a section on networks, without its tables."""
    text = f"{text_of(EVIDENCE)}\n### "
    (found,) = re.findall(rf"^### {title}\n(.*?)^### ", text, re.DOTALL | re.MULTILINE)
    found = re.sub(r"^(?:\||<!--).*$", "", found, flags=re.MULTILINE)
    return " ".join(re.sub(r"\]\([^)]*\)", "", found).replace("[", "").split())


ADAPTIVE, SLC, PINV = "adaptive, known J", "slc, J known", "pseudoinverse"
TAYLOR, FOUR_STEP = "zeroing, linear, taylor", "zeroing, linear, four step"
BEHIND, LINEAR = "recursive, n = 1", "zeroing, linear"


def alike(table):
    """The rows of the networks that are said to be one: most of the zeroing and projection ones."""
    return [
        row
        for name, row in table.items()
        if name.startswith(("zeroing", "projection")) and name not in {TAYLOR, FOUR_STEP}
    ]


def nearest(table, kind):
    """The networks with the least error under a disturbance, as their table has it."""
    return sorted(table, key=lambda name: float(table[name][kind]))


def stated_of_networks(networks):
    """Return the clauses with numbers that the tables of networks make."""
    table, less = networks[500], networks["feedback"]
    ours, slc, pinv, linear = (table[name] for name in (ADAPTIVE, SLC, PINV, LINEAR))
    learned, peer = table["adaptive, J learned"], table["projection, J learned"]
    one = [float(row["constant"]) for row in alike(table)]
    assert (
        set(nearest(table, "constant")[:2]) == set(nearest(table, "ramp")[:2]) == {ADAPTIVE, PINV}
    )
    assert nearest(table, "random")[0] == PINV
    assert nearest(table, "measured")[0] == FOUR_STEP
    assert [kind for kind in EVERY if float(ours[kind]) > float(slc[kind])] == ["measured"]
    return [
        f"are {min(one)} to {max(one)} mm off under a constant disturbance",
        f"under constant ({ours['constant']} and {pinv['constant']} mm) and ramp ({ours['ramp']},"
        f" {pinv['ramp']}), the pseudoinverse under random ({pinv['random']}, the adaptive law"
        f" {ours['random']})",
        f"the pseudoinverse asks for {pinv[SHAKES]} rad/s², the law for {ours[SHAKES]}",
        f"follows {table[BEHIND]['none']} mm behind",
        f"`four_step` is nearest, {table[FOUR_STEP]['measured']} mm",
        f"the linear network is {less['80']['measured']} mm off, but {less['80']['constant']} under"
        f" a constant disturbance, and asks for {less['80'][SHAKES]} rad/s² in place of"
        f" {linear[SHAKES]}",
        f"but for noise ({ours['measured']} against {slc['measured']} mm); `slc` fails in"
        f" {slc['failed']} runs",
        f"the adaptive law is {learned['constant']} mm off under a constant disturbance",
        f"is {peer['constant']} off, and asks for {peer[SHAKES]} rad/s² with noise",
    ]


def test_the_advice_on_networks_is_what_their_tables_say(networks):
    left = words_below("Which one to take")
    for clause in stated_of_networks(networks):
        assert clause in left, clause
        left = left.replace(clause, "", 1)
    assert not re.findall(r".{0,20}\d.{0,20}", left.replace("With 80/s", ""))


def test_what_is_said_of_other_rates_is_what_their_tables_say(networks):
    fast, slow = networks[1000][LINEAR], networks[250][LINEAR]
    assert (
        f"is {fast['constant']} mm off at 1 kHz and {slow['constant']} at 250 Hz; with noise"
        f" {fast['measured']} and {slow['measured']}"
    ) in words_below("At 1 kHz and at 250 Hz")


def test_with_noise_alone_less_feedback_is_always_nearer(networks):
    errors = [float(row["measured"]) for row in networks["feedback"].values()]
    assert errors == sorted(errors)
    assert list(map(float, networks["feedback"])) == sorted(map(float, networks["feedback"]))


def test_laws_said_to_keep_bounds_do():
    assert {"position", "velocity", "acceleration"} <= {*load_experiment("slc_nephroid").law.keeps}


@pytest.mark.parametrize("rate", RATES)
def test_feedback_is_varied_up_to_what_a_law_accepts(rate):
    """99 % of the rate runs; more than the rate, which is 1 / period, is refused."""
    limits = {"velocity": 1.5, "acceleration": 15.0}
    for kind, key in (("zeroing", "feedback"), ("projection", "feedback"), ("adaptive", "kappa")):
        document = {"law": {"kind": kind, key: 0.99 * rate}, "period": 1.0 / rate, "accept": None}
        load_experiment("zeroing_noise", document | {"limits": limits})
        document["law"][key] = 1.01 * rate
        with pytest.raises(InvalidInputError, match=rf"law\.{key}"):
            load_experiment("zeroing_noise", document | {"limits": limits})
