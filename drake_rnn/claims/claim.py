"""Claims of a paper, and the criteria that they must meet to hold."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field

from ..errors import InvalidInputError
from ..experiment.document import Acceptance
from ..inputs.fields import Finite, validated
from ..inputs.keys import Meaning

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
            given = ", ".join(f"{name}={value}" for name, value in self.given.items())
            return f"{self.measure}({given})"
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
    given = "".join(f" --set {key}={_inline(value)}" for key, value in (changes or {}).items())
    return f"drake-rnn run {name}{given}"


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
