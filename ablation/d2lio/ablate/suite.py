# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A suite: which variants run on which sequences how often, and how their table is drawn."""

from __future__ import annotations

import re
import types
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import yaml
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    model_validator,
)

from d2lio.errors import ConfigError
from d2lio.strict_yaml import Location, first_complaint, read_yaml

SHIPPED = Path(__file__).parent / "suites"
SUFFIX = ".yaml"

Text = Annotated[str, Field(min_length=1)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
# Names become directories and column names.
Identifier = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$", max_length=60)]


def slug(name: str) -> str:
    """A sequence's name as the name of a directory."""
    return re.sub(r"[^A-Za-z0-9._-]+", "_", name).strip(".") or "_"


def _listed(value: Any) -> Any:
    return [value] if isinstance(value, str) else value


def _switch(value: Any) -> Any:
    return "off" if value is False else value  # YAML reads an unquoted off as false


def _plain(value: Any) -> Any:
    if isinstance(value, bool):
        return "true" if value else "false"
    return str(value) if isinstance(value, int | float) else value


def _registered(kind: str) -> AfterValidator:
    def check(name: str) -> str:
        from d2lio import simulator

        registry = {
            "scene": simulator.SCENES,
            "sensor": simulator.SENSORS,
            "imu": simulator.IMU_GRADES,
        }[kind]
        if name not in registry:
            raise ValueError("one of " + ", ".join(registry))
        return name

    return AfterValidator(check)


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, protected_namespaces=())


class Limits(_Strict):
    """What one run may take: wall time in s, memory of all its processes together in MB."""

    time_s: Positive = 600.0
    memory_mb: Positive = 4000.0


class Layout(_Strict):
    """How the table is drawn; `blocks: group` draws one block for each group of variants."""

    rows: Literal["sequence", "variant"] = "sequence"
    columns: Literal["sequence", "variant"] = "variant"
    blocks: Literal["none", "group"] = "none"

    @model_validator(mode="after")
    def _differ(self) -> Layout:
        if self.rows == self.columns:
            raise ValueError("rows and columns that differ")
        return self


class Simulate(_Strict):
    """A sequence to simulate; repeat k has the seed `seed_base` + k.

    `duration` in s, standstill included; unset is the scene's own. `orientation`: a 9-axis IMU.
    """

    scene: Annotated[str, _registered("scene")]
    sensor: Annotated[str, _registered("sensor")] = "vlp16"
    duration: Positive | None = None
    imu: Annotated[str, _registered("imu")] = "industrial"
    seed_base: Annotated[int, Field(ge=0)] = 0
    orientation: bool = False


class SuiteSequence(_Strict):
    """A sequence, simulated or recorded or both.

    Attributes:
        recording: names in `d2lio datasets list`; the first that is found below --data is used.
        groups: only the variants of these groups run on it; empty is all of them.
    """

    name: Text
    dataset: str = ""
    simulate: Simulate | None = None
    recording: Annotated[list[Text], BeforeValidator(_listed)] = []
    groups: list[Text] = []

    @model_validator(mode="after")
    def _has_source(self) -> SuiteSequence:
        if self.simulate is None and not self.recording:
            raise ValueError("`simulate`, `recording` or both")
        return self


class Variant(_Strict):
    """A host with a configuration, or a column of imported trajectories.

    Attributes:
        group: variants of one group stand in one block of the table.
        host: an estimator or a peer; rejection and degeneracy unset are the host's own.
        import_: name that `--import NAME=DIR` fills.
    """

    model_config = ConfigDict(populate_by_name=True)

    id: Identifier
    title: str = ""
    group: str = ""
    host: str | None = None
    rejection: Annotated[str | None, BeforeValidator(_switch)] = None
    degeneracy: Annotated[str | None, BeforeValidator(_switch)] = None
    params: dict[Text, Annotated[str, BeforeValidator(_plain)]] = {}
    import_: Annotated[str | None, Field(alias="import")] = None

    @model_validator(mode="after")
    def _one_source(self) -> Variant:
        if (self.host is None) == (self.import_ is None):
            raise ValueError("either `host` or `import`")
        if self.import_ is not None and (self.rejection or self.degeneracy or self.params):
            raise ValueError("no rejection, degeneracy or params beside `import`")
        return self

    @property
    def label(self) -> str:
        """The title, or the id where there is none."""
        return self.title or self.id


class Paper(_Strict):
    """A table of the paper beside ours: its CSV file, and its column of each variant."""

    table: Text
    columns: dict[Identifier, Text]


class Figures(_Strict):
    """Figures that the report draws."""

    trajectories: bool = True
    lambda_min: bool = True


class Suite(_Strict):
    """A suite file.

    Attributes:
        repeats: of each cell: seeds of simulated sequences, start offsets of recordings.
        offset_step_s: repeat k of a recording starts k times this later.
        baseline: the variant that paired differences refer to; None draws none.
    """

    name: Identifier
    title: str = ""
    description: str = ""
    repeats: Annotated[int, Field(ge=1, le=1000)] = 5
    offset_step_s: Annotated[float, Field(ge=0.0, allow_inf_nan=False)] = 2.0
    limits: Limits = Limits()
    baseline: str | None = None
    layout: Layout = Layout()
    sequences: Annotated[list[SuiteSequence], Field(min_length=1)]
    variants: Annotated[list[Variant], Field(min_length=1)]
    paper: Paper | None = None
    figures: Figures = Figures()

    @model_validator(mode="after")
    def _consistent(self) -> Suite:
        ids = [variant.id for variant in self.variants]
        _unique("variants", ids)
        _unique("sequences", [slug(sequence.name).lower() for sequence in self.sequences])
        if self.baseline is not None and self.baseline not in ids:
            raise ValueError(f"baseline {self.baseline!r}: one of {', '.join(ids)}")
        groups = {variant.group for variant in self.variants}
        for sequence in self.sequences:
            unknown = [group for group in sequence.groups if group not in groups]
            if unknown:
                raise ValueError(f"groups {unknown} of {sequence.name}: groups of variants")
        return self

    @classmethod
    def parse(cls, data: object, where: str = "") -> Suite:
        """Validates nested mappings.

        Raises:
            ConfigError: names the first bad key, its value and what is allowed.
        """
        try:
            return cls.model_validate(data)
        except ValidationError as error:
            raise first_complaint(error, where, "suite", _known_keys, _summary) from None

    @classmethod
    def load(cls, file: Path) -> Suite:
        """Reads a YAML file.

        Raises:
            DataError: unreadable; ConfigError: see `parse`.
        """
        return cls.parse(read_yaml(file), str(file))

    def to_yaml(self) -> str:
        """The suite as YAML with every value stated; reading it gives the same suite."""
        data = self.model_dump(by_alias=True)
        for variant in data["variants"]:
            unused = ("host", "rejection", "degeneracy", "import")
            for key in [k for k in unused if variant[k] is None]:
                del variant[key]
        return yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=100)

    def variant(self, identifier: str) -> Variant:
        """The variant of that id."""
        return next(v for v in self.variants if v.id == identifier)

    def sequence(self, name: str) -> SuiteSequence:
        """The sequence of that name."""
        return next(s for s in self.sequences if s.name == name)

    def variants_of(self, sequence: SuiteSequence) -> list[Variant]:
        """The variants that run on a sequence."""
        return [v for v in self.variants if not sequence.groups or v.group in sequence.groups]

    def reduced(
        self,
        *,
        repeats: int | None = None,
        sequences: list[str] | None = None,
        variants: list[str] | None = None,
    ) -> Suite:
        """The same suite with fewer repeats, sequences or variants; None keeps all.

        Raises:
            ConfigError: a name that the suite does not have.
        """
        kept_variants = _chosen("--only-variants", variants, {v.id: v for v in self.variants})
        known = {s.name: s for s in self.sequences}
        kept_sequences = _chosen("--only-sequences", sequences, known)
        groups = {variant.group for variant in kept_variants}
        pruned = []
        for sequence in kept_sequences:
            left = [group for group in sequence.groups if group in groups]
            if left or not sequence.groups:
                pruned.append(sequence.model_copy(update={"groups": left}))
        ids = [variant.id for variant in kept_variants]
        paper = self.paper
        if paper is not None:
            columns = {k: v for k, v in paper.columns.items() if k in ids}
            paper = paper.model_copy(update={"columns": columns})
        changes: dict[str, Any] = {
            "repeats": self.repeats if repeats is None else repeats,
            "sequences": pruned,
            "variants": kept_variants,
            "baseline": self.baseline if self.baseline in ids else None,
            "paper": paper,
        }
        return Suite.parse(self.model_copy(update=changes).model_dump(by_alias=True), self.name)


def _unique(what: str, names: list[str]) -> None:
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ValueError(f"{what} of different names; {', '.join(twice)} stands there twice")


def _chosen(option: str, wanted: list[str] | None, known: dict[str, Any]) -> list[Any]:
    """The wanted ones in the order of the suite."""
    if wanted is None:
        return list(known.values())
    for name in wanted:
        if name not in known:
            raise ConfigError(option, name, ", ".join(known))
    return [entry for name, entry in known.items() if name in wanted]


def shipped() -> dict[str, Path]:
    """The suites that come with the package, by name."""
    return {file.stem: file for file in sorted(SHIPPED.glob(f"*{SUFFIX}"))}


def load_suite(name: str) -> Suite:
    """A shipped suite by its name, or one from a YAML file.

    Raises:
        ConfigError: neither a shipped name nor a file, or a bad key; DataError: unreadable.
    """
    known = shipped()
    if name in known:
        return Suite.load(known[name])
    if not Path(name).is_file():
        raise ConfigError("suite", name, f"{', '.join(known)}, or a YAML file")
    return Suite.load(Path(name))


def _summary(value: object) -> object:
    return "..." if isinstance(value, dict | BaseModel) else value  # the message says what is wrong


def _known_keys(location: Location) -> str:
    """Keys of the section that holds the key at `location`."""
    model: type[BaseModel] = Suite
    for part in location[:-1]:
        if isinstance(part, str) and part in model.model_fields:
            model = _model_in(model.model_fields[part].annotation) or model
    return ", ".join(field.alias or name for name, field in model.model_fields.items())


def _model_in(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    if get_origin(annotation) in (list, Union, types.UnionType, Annotated):
        found = (_model_in(inner) for inner in get_args(annotation))
        return next((model for model in found if model is not None), None)
    return None
