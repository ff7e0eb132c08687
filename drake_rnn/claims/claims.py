"""Claims of a paper, and the criteria that they must meet to hold.

- The claims files: one for each paper, beside the module with its measures.
- The JSON schema of files of claims, for editors.
- Shared parts of the papers' measures: the runs they look at, costs, and signals of laws.
- Verdicts on claims, computed from runs.
- Sources of the numbers for judging: runs, their metrics, and measures taken from them.
"""

from __future__ import annotations

import inspect
import json
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from math import nan
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any, Literal, Protocol

import numpy as np
from pydantic import Field

from ..errors import DrakeRnnError, InterruptedRunError, InvalidInputError
from ..experiment import load_experiment, make_experiment, read_document, shipped_experiments
from ..experiment.document import Acceptance
from ..experiment.keys import CHANGES, KNOWN_CHANGES, OpenFields, experiment_definitions
from ..inputs.documents import construct, read_yaml, without_extensions
from ..inputs.fields import Array, Finite, validated
from ..inputs.keys import Meaning, Schema, or_null, whole_document
from ..inputs.messages import nearest
from ..jobs.requests import RunRequest, request_of
from ..measures import METRICS
from ..runs.result import Result
from ..runs.simulation import simulate

#: Parts of the criteria of a claim, as the pages name them.
Part = Literal["as stated", "with the correction", "instead"]

#: A claim's name consists of the scheme and the place in the paper.
_ID = re.compile(r"[a-z]+-(?:T|F|Th|L|R|S|C)\d[\da-z.]*")


@validated
class Quantity:
    """A number that a run or a calculation gives."""

    run: Annotated[
        str | None,
        Meaning("Name of a shipped experiment; give either this or ``measure``."),
    ] = None
    set: Annotated[
        dict[str, Any],
        Meaning("Changes of the experiment, by dotted key."),
    ] = Field(default_factory=dict)
    metric: Annotated[str | None, Meaning("Metric of the run.")] = None
    measure: Annotated[
        str | None,
        Meaning("Name of a function of the module beside the claims file."),
    ] = None
    given: Annotated[
        dict[str, Any],
        Meaning("Arguments of that function, by name."),
    ] = Field(default_factory=dict)

    def __post_init__(self) -> None:
        if (self.run is None) == (self.measure is None):
            raise ValueError("give either run or measure")
        if self.run is None and (self.set or self.metric is not None):
            raise ValueError("set and metric belong to a run")
        if self.measure is None and self.given:
            raise ValueError("given belongs to a measure")
        if self.run is not None and self.metric is None:
            raise ValueError("metric: must be given with run")

    def __str__(self) -> str:
        if self.measure is not None:
            arguments = ", ".join(f"{name}={value}" for name, value in self.given.items())
            return f"{self.measure}({arguments})"
        return f"{self.metric} of {self.command}"

    @property
    def command(self) -> str:
        """Command that makes the run."""
        return run_command(str(self.run), self.set)


@validated
class Criterion(Quantity):
    """A number and its bounds."""

    per: Annotated[
        Quantity | None,
        Meaning("What the number is divided by; None for nothing."),
    ] = None
    at_least: Annotated[Finite | None, Meaning("Bounds of the number, in its own unit.")] = None
    at_most: Annotated[Finite | None, Meaning("Bounds of the number, in its own unit.")] = None
    paper: Annotated[str, Meaning("The paper's own figure, for a reader.")] = ""
    wide_because: Annotated[
        str,
        Meaning(
            "Why a bound is far from both the number that was measured and the paper's figure; "
            "``round-off`` for a number that would be zero in exact arithmetic.",
        ),
    ] = ""
    timed: Annotated[
        bool,
        Meaning("Whether the number is a ratio of times, which a busy machine disturbs."),
    ] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        try:
            self.bounds  # noqa: B018  it checks them
        except InvalidInputError as error:
            raise ValueError(str(error).removeprefix("Acceptance: ")) from None

    @property
    def bounds(self) -> Acceptance:
        """The bounds of the number."""
        return Acceptance(at_least=self.at_least, at_most=self.at_most)

    def __str__(self) -> str:
        return super().__str__() + (f", per {self.per}" if self.per is not None else "")


@validated
class Claim:
    """One statement of a paper, and how it is judged.

    As stated is what is printed: equations and settings. Where the text leaves a choice, and for a
    physical experiment, which is simulated, it is the reading that ``because`` names. A correction
    changes what is printed: a law, a parameter or a formula. A weaker claim, such as one with
    another bound, another quantity or without one of its halves, is no correction: it is what holds
    instead.
    """

    id: Annotated[
        str,
        Meaning(
            "Scheme and place in the paper, e.g. ``slc-F2a`` for Fig. 2(a): T table, F figure, "
            "Th theorem, L lemma, R remark, S section, C claim in the text.",
        ),
    ]
    where: Annotated[str, Meaning("Place in the paper, in words.")]
    says: Annotated[str, Meaning("What the paper says, in our words.")]
    as_stated: Annotated[
        list[Criterion],
        Meaning("Criteria that must be met for the claim to hold."),
    ] = Field(default_factory=list)
    corrected: Annotated[
        list[Criterion],
        Meaning("Criteria for it to hold with the correction that ``because`` names."),
    ] = Field(default_factory=list)
    instead: Annotated[
        list[Criterion],
        Meaning(
            "Criteria of what holds instead, or can be said all the same; they do not change the "
            "verdict.",
        ),
    ] = Field(default_factory=list)
    unchecked: Annotated[
        str,
        Meaning("Why the claim cannot be checked; in place of criteria as stated."),
    ] = ""
    because: Annotated[
        str,
        Meaning(
            "Why it does not hold as stated, what is corrected, or what was chosen where the "
            "paper is silent.",
        ),
    ] = ""
    tests: Annotated[
        list[str],
        Meaning("Tests that show it too, as pytest names them."),
    ] = Field(default_factory=list)

    def __post_init__(self) -> None:
        if not _ID.fullmatch(self.id):
            raise ValueError(f"id: must be like slc-F2a or jdf-Th1, not {self.id!r}")
        if bool(self.unchecked) == bool(self.as_stated):
            raise ValueError("give either as_stated or unchecked")
        if self.corrected and not (self.as_stated and self.because):
            raise ValueError("corrected: needs as_stated, and because, which names the correction")

    @property
    def command(self) -> str:
        """Command that judges the claim."""
        return f"drake-rnn claims {self.id} --judge"

    @property
    def parts(self) -> dict[Part, list[Criterion]]:
        """The criteria by part."""
        return {
            "as stated": self.as_stated,
            "with the correction": self.corrected,
            "instead": self.instead,
        }

    @property
    def criteria(self) -> list[Criterion]:
        """All criteria, part by part."""
        return [criterion for part in self.parts.values() for criterion in part]


@validated
class Paper:
    """A paper."""

    title: Annotated[str, Meaning("Its title.")]
    authors: Annotated[str, Meaning("Its authors; none if they are not known here.")] = ""
    journal: Annotated[str, Meaning("Where it appeared; none if it is not known here.")] = ""
    year: Annotated[int | None, Meaning("When it appeared; None if it is not known here.")] = None
    doi: Annotated[
        str,
        Meaning("Its digital object identifier; none if it is not known here."),
    ] = ""

    def __str__(self) -> str:
        parts = [self.authors, f'"{self.title}"', self.journal]
        year = f" ({self.year})" if self.year is not None else ""
        doi = f", doi:{self.doi}" if self.doi else ""
        return ", ".join(filter(None, parts)) + year + doi


def run_command(name: str, changes: Mapping[str, Any] | None = None) -> str:
    """Return the command line that runs a shipped experiment with changes by dotted key."""
    options = "".join(f" --set {key}={_inline(value)}" for key, value in (changes or {}).items())
    return f"drake-rnn run {name}{options}"


def _inline(value: Any) -> str:
    """Return a value as the text of one word of a command line."""
    if isinstance(value, bool) or value is None:
        return {True: "true", False: "false", None: "null"}[value]
    if isinstance(value, list):
        return f"[{','.join(map(_inline, value))}]"
    if isinstance(value, dict):
        entries = ", ".join(f"{key}: {_inline(entry)}" for key, entry in value.items())
        return f"'{{{entries}}}'"
    if isinstance(value, float):
        short = f"{value:g}"
        return short if float(short) == value else repr(value)
    return str(value)


_FOLDER = Path(__file__).parent / "papers"
#: The papers' schemes; each has a claims file and a module with its measures.
SCHEMES = tuple(sorted(file.stem for file in _FOLDER.glob("*.yaml")))


@validated
class ClaimsFile:
    """What one paper claims, as plain data."""

    prefix: Annotated[str, Meaning("What the names of its claims begin with, before a hyphen.")]
    paper: Annotated[dict[str, Any], Meaning("The paper, the fields of `Paper`.")]
    page: Annotated[str, Meaning("Page of the repository about it.")]
    claims: Annotated[list[dict[str, Any]], Meaning("Its claims, each with the fields of `Claim`.")]


@dataclass(frozen=True)
class Claims:
    """All that one paper claims.

    Attributes:
        scheme: The paper's scheme, one of `SCHEMES`.
        paper: The paper.
        page: Page of the repository about it.
        claims: Its claims.
        measures: Functions that the claims' criteria name; each takes a function
            ``run(name, changes) -> Result`` and the criterion's arguments, and returns a number.
    """

    scheme: str
    paper: Paper
    page: str
    claims: tuple[Claim, ...]
    measures: Mapping[str, Callable[..., float]]

    def sharing(self, claim: Claim) -> tuple[str, ...]:
        """Return the names of the other claims that are judged by a number of this one."""
        numbers = set(map(str, claim.criteria))
        return tuple(
            other.id
            for other in self.claims
            if other.id != claim.id and not numbers.isdisjoint(map(str, other.criteria))
        )

    def reason(self, claim: Claim) -> str:
        """Return why the verdict is what it is, with the claims that rest on the same numbers."""
        text = claim.because or claim.unchecked
        if others := ", ".join(self.sharing(claim)):
            text = f"{text} Shares a number with {others}.".strip()
        return text


def schemes_in(folder: Path | None = None) -> tuple[str, ...]:
    """Return the schemes that have a claims file in a folder; by default `SCHEMES`.

    Raises:
        InvalidInputError: If there is none.
    """
    if folder is None:
        return SCHEMES
    if not (schemes := tuple(sorted(file.stem for file in folder.glob("*.yaml")))):
        raise InvalidInputError(f"claims: no claims file, *.yaml, in {folder}")
    return schemes


def read_claims(scheme: str, folder: Path | None = None) -> Claims:
    """Return the claims of a paper.

    Args:
        scheme: Its scheme, one of `schemes_in` the folder.
        folder: Folder with claims files; by default that of the shipped ones, which are read once.
            Measures are those of the shipped file of the same name.

    Raises:
        InvalidInputError: If a claim is not as it should be; the message names claim and key.
    """
    if scheme not in (available := schemes_in(folder)):
        raise InvalidInputError(f"claims: no scheme {scheme!r}; {nearest(scheme, list(available))}")
    return _shipped_claims(scheme) if folder is None else _read(folder / f"{scheme}.yaml")


@cache
def _shipped_claims(scheme: str) -> Claims:
    return _read(_FOLDER / f"{scheme}.yaml")


def _read(file: Path) -> Claims:
    content = construct(ClaimsFile, without_extensions(read_yaml(file)), file.name)
    claims = tuple(
        construct(Claim, claim, f"{file.name}: {claim.get('id', f'claim {number}')}")
        for number, claim in enumerate(content.claims, start=1)
    )
    measures = _measures(file.stem) if file.stem in SCHEMES else {}
    for claim in claims:
        for quantity in quantities_of(claim):
            _check_known(f"{file.name}: {claim.id}", quantity, measures)
        if not claim.id.startswith(f"{content.prefix}-"):
            raise InvalidInputError(f"{file.name}: {claim.id}: must begin with {content.prefix}-")
    names = [claim.id for claim in claims]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise InvalidInputError(f"{file.name}: {twice[0]} is there twice")
    paper = construct(Paper, content.paper, f"{file.name}: paper")
    return Claims(file.stem, paper, content.page, claims, measures)


def _measures(scheme: str) -> dict[str, Callable[..., float]]:
    if not (_FOLDER / f"{scheme}.py").is_file():
        # All that it claims is judged by metrics.
        return {}
    module = import_module(f"{__package__}.papers.{scheme}")
    return {
        name: function
        for name, function in inspect.getmembers(module, inspect.isfunction)
        if function.__module__ == module.__name__ and not name.startswith("_")
    }


def quantities_of(claim: Claim) -> list[Quantity]:
    """Return the numbers that judge a claim, and those that they are divided by."""
    divisors = [criterion.per for criterion in claim.criteria if criterion.per is not None]
    return [*claim.criteria, *divisors]


def _check_known(place: str, quantity: Quantity, measures: Mapping[str, Any]) -> None:
    for name, available, what in (
        (quantity.run, shipped_experiments(), "experiment"),
        (quantity.metric, METRICS.names, "metric"),
        (quantity.measure, measures, "measure"),
    ):
        if name is not None and name not in available:
            raise InvalidInputError(
                f"{place}: no {what} {name!r}; "
                f"{nearest(name, list(available)) if available else 'none'}"
            )
    if quantity.measure is not None:
        try:
            inspect.signature(measures[quantity.measure]).bind(None, **quantity.given)
        except TypeError as error:
            raise InvalidInputError(f"{place}: {quantity.measure}: given: {error}") from None


def claims_schema() -> Schema:
    """Return the JSON schema of a file of claims."""
    open_fields: OpenFields = {
        (Quantity, "run"): or_null({"enum": shipped_experiments()}),
        (Quantity, "metric"): or_null({"enum": [*METRICS.names]}),
        (Quantity, "set"): {"allOf": [CHANGES, KNOWN_CHANGES]},
        (ClaimsFile, "paper"): {"$ref": "#/$defs/Paper"},
        (ClaimsFile, "claims"): {"type": "array", "items": {"$ref": "#/$defs/Claim"}},
    }
    definitions = experiment_definitions(open_fields, ClaimsFile, Claim, Paper)
    document = definitions.pop("ClaimsFile")
    return whole_document(document, "Claims of a paper, judged by drake_rnn", definitions)


#: Signals that only a model of the arm can give.
STRUCTURE = frozenset({"J", "J_omega", "Jdot_v", "M", "bias", "gravity"})


class Run(Protocol):
    """A function that returns the result of a shipped experiment with changes by dotted key."""

    def __call__(self, name: str, changes: Mapping[str, Any] | None = None, /) -> Result:
        """Return the result; the run is made once, however often it is asked for."""


def signals_of_structure(name: str, among: Collection[str] = STRUCTURE) -> float:
    """Return the number of signals of an arm's structure that a law sees [1].

    Args:
        name: Name of the shipped experiment with the law.
        among: Signals that count.
    """
    return float(len(set(among) & set(load_experiment(name).law.inputs.parts)))


def time_ratio(one: Callable[[], object], other: Callable[[], object], rounds: int = 1000) -> float:
    """Return the ratio of the times of two calculations [1].

    Both are timed in turn, and the least time of each counts, as it is the least disturbed.

    Args:
        one: The calculation.
        other: The other one.
        rounds: Number of times that each is made.
    """
    times = [[_time(one), _time(other)] for _ in range(rounds)]
    first, second = np.min(times, axis=0)
    return float(first / second)


def _time(calculation: Callable[[], object]) -> float:
    began = perf_counter()
    calculation()
    return perf_counter() - began


def end_of_chain(
    q: Array, alpha: Sequence[float], a: Sequence[float], d: Sequence[float]
) -> tuple[Array, Array]:
    """Return the end's position and Jacobian of a chain by Denavit and Hartenberg.

    Args:
        q: Angles of the joints, shape (n,) [rad].
        alpha: Twists of the links, n numbers [rad].
        a: Their lengths [m].
        d: Their offsets [m].

    Returns:
        Position, shape (3,), and Jacobian, shape (3, n).
    """
    X, frames = np.eye(4), []
    for angle, twist, length, offset in zip(q, alpha, a, d, strict=True):
        frames.append(X)
        s, c, sa, ca = np.sin(angle), np.cos(angle), np.sin(twist), np.cos(twist)
        X = X @ np.array(
            [
                [c, -s * ca, s * sa, length * c],
                [s, c * ca, -c * sa, length * s],
                [0, sa, ca, offset],
                [0, 0, 0, 1],
            ]
        )
    p, stack = X[:3, 3], np.array(frames)
    return p, np.cross(stack[:, :3, 2], p - stack[:, :3, 3]).T


class RunSource(ABC):
    """Runs of shipped experiments, each of which is made once, however often it is asked for."""

    def __init__(self) -> None:
        self._requests: dict[str, RunRequest] = {}

    def request(self, name: str, changes: Mapping[str, Any] | None = None) -> RunRequest:
        """Return the request of the run of an experiment with changes by dotted key.

        Raises:
            InvalidInputError: If the changes are none of this experiment.
        """
        values = dict(changes or {})
        text = json.dumps([name, values], sort_keys=True)
        if text not in self._requests:
            contents = read_document(name, values)
            self._requests[text] = request_of(contents, experiment=name, changes=values)
        return self._requests[text]

    @abstractmethod
    def run(self, name: str, changes: Mapping[str, Any] | None = None, /) -> Result:
        """Return the result of an experiment with changes by dotted key.

        Raises:
            DrakeRnnError: If it is refused or fails.
        """

    def metrics(self, name: str, changes: Mapping[str, Any] | None = None, /) -> dict[str, float]:
        """Return the metrics of an experiment with changes by dotted key.

        Raises:
            DrakeRnnError: If it is refused or fails.
        """
        return self.run(name, changes).metrics

    def measure(self, claims: Claims, quantity: Quantity) -> float:
        """Return the number of a quantity that a measure gives.

        Args:
            claims: The paper's claims, with its measures.
            quantity: The quantity.

        Raises:
            DrakeRnnError: If a run that it looks at is refused or fails.
        """
        return float(claims.measures[str(quantity.measure)](self.run, **quantity.given))


class SimulatedRuns(RunSource):
    """Runs that this process makes and keeps in memory, those that fail too."""

    def __init__(self) -> None:
        super().__init__()
        self._known: dict[str, Result | DrakeRnnError] = {}

    def run(self, name: str, changes: Mapping[str, Any] | None = None, /) -> Result:
        """Return the result of an experiment with changes by dotted key.

        Raises:
            DrakeRnnError: If it is refused or fails.
        """
        request = self.request(name, changes)
        if (key := request.key) not in self._known:
            try:
                self._known[key] = simulate(make_experiment(request.document))
            except InterruptedRunError:
                raise
            except DrakeRnnError as error:
                # Without the traceback, which would keep the whole run in memory.
                self._known[key] = error.with_traceback(None)
        result = self._known[key]
        if isinstance(result, DrakeRnnError):
            raise result.with_traceback(None)
        return result


class _NoNumberError(DrakeRnnError):
    """A number that a run does not have."""


ClaimVerdict = Literal[
    "holds", "holds with correction", "does not hold", "cannot be checked", "failed"
]


@dataclass(frozen=True)
class Finding:
    """The number measured for one criterion, and whether it is met.

    Attributes:
        criterion: The criterion.
        holds: Whether it is met.
        value: The number; NaN if there is none.
        failure: Why there is no number: the run does not have it.
        error: Error of a run or a measure that was expected to work; empty if there was none.
    """

    criterion: Criterion
    holds: bool
    value: float = nan
    failure: str = ""
    error: str = ""

    def __str__(self) -> str:
        return self.error or self.failure or f"{self.value:.3g}"


@dataclass(frozen=True)
class Judgement:
    """The findings on one claim, and the verdict that follows.

    A claim holds if all its criteria as stated are met; else it holds with correction if it has
    corrected criteria and all of them are met; else it does not hold, whatever holds instead. Where
    a run or a measure failed that was expected to work, the judgement itself has failed: it says
    nothing of the claim.

    Attributes:
        claim: The claim.
        parts: Findings on each part of its criteria, criterion by criterion.
    """

    claim: Claim
    parts: Mapping[Part, tuple[Finding, ...]] = field(default_factory=dict)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All findings, part by part."""
        return tuple(finding for part in self.parts.values() for finding in part)

    @property
    def verdict(self) -> ClaimVerdict:
        """The verdict."""
        if any(finding.error for finding in self.findings):
            return "failed"
        if self.claim.unchecked:
            return "cannot be checked"
        if self._is_met("as stated"):
            return "holds"
        if self._is_met("with the correction"):
            return "holds with correction"
        return "does not hold"

    def _is_met(self, part: Part) -> bool:
        findings = self.parts.get(part, ())
        return bool(findings) and all(finding.holds for finding in findings)


@dataclass(frozen=True)
class Judge:
    """Judges the claims of a paper.

    Args:
        claims: The paper's claims.
        runs: Where its runs come from; by default they are made here.
    """

    claims: Claims
    runs: RunSource = field(default_factory=SimulatedRuns, repr=False)

    def judge(self, claim: Claim) -> Judgement:
        """Return the judgement of a claim.

        Raises:
            DrakeRnnError: If a run is refused or fails: the claim says nothing then.
        """
        return Judgement(
            claim,
            {part: tuple(map(self.find, criteria)) for part, criteria in claim.parts.items()},
        )

    def find(self, criterion: Criterion) -> Finding:
        """Return the finding on one criterion.

        Raises:
            DrakeRnnError: If a run is refused or fails.
        """
        try:
            value = self._value(criterion)
            if criterion.per is not None:
                if (divisor := self._value(criterion.per)) == 0.0:
                    raise _NoNumberError("no ratio: divided by 0")
                value /= divisor
        except _NoNumberError as error:
            return Finding(criterion, False, failure=str(error))
        return Finding(criterion, criterion.bounds.holds(value), value)

    def _value(self, quantity: Quantity) -> float:
        if quantity.measure is not None:
            return self.runs.measure(self.claims, quantity)
        metrics, name = self.runs.metrics(str(quantity.run), quantity.set), str(quantity.metric)
        if name not in metrics:
            # Such as a time of settling, of a run that did not settle.
            raise _NoNumberError(f"no {name} in this run")
        return metrics[name]
