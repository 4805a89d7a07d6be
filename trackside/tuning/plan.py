"""Which parameter sets are tried with which algorithm; everything wrong is told before any run."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

import numpy as np

from dialogue import UsageError, nearest_names
from slam.algorithms import CONES, ODOMETRY, Request
from trackside.tuning.space import ParameterSet, Range, Space, draws, grid

TRIES = 200
"""So often one place of a random search is drawn again when its values contradict each other."""


@dataclass(frozen=True)
class Trial:
    """One parameter set with one algorithm; `number` 0 is the preset as it is."""

    number: int
    parameters: ParameterSet
    request: Request


@dataclass(frozen=True)
class Plan:
    """All trials, in the order of their numbers; `impossible` sets contradicted themselves."""

    trials: tuple[Trial, ...]
    impossible: int


def planned(space: Space, requests: Sequence[Request], runs: int | None, seed: int) -> Plan:
    """The preset of each request (one per algorithm) and the sets that differ from it.

    runs : sets drawn at random, or None for every combination. A parameter that only some of the
    algorithms have is left out for the others. Raises `UsageError` for parameters that none has
    and for values that cannot be.
    """
    known = {request.algorithm: _known(space, request) for request in requests}
    faults = _unknown(space, requests, known)
    if faults:
        raise UsageError("\n".join(faults))
    faults = [fault for request in requests for fault in _value_faults(space, request, known)]
    if faults:
        raise UsageError("\n".join(dict.fromkeys(faults)))
    trials: list[Trial] = []
    impossible = 0
    for request in requests:
        own = {key: space[key] for key in space if key in known[request.algorithm]}
        found: dict[tuple[tuple[str, str], ...], Trial] = {(): Trial(0, {}, request)}
        for number, candidates in enumerate(_places(own, request, runs, seed), start=1):
            trial = next((t for c in candidates if (t := _trial(number, c, request))), None)
            if trial is None:
                impossible += 1
            else:
                found.setdefault(tuple(sorted(trial.parameters.items())), trial)
        trials += found.values()
    if len(trials) == len(requests):
        raise UsageError("no parameter set is possible: the values contradict each other")
    return Plan(tuple(trials), impossible)


def parameter_names(request: Request) -> list[str]:
    """Everything that can be set for an algorithm, as `--set` names it."""
    parts = (("", request.config()), (CONES, request.cone_config()))
    named = [*parts, (ODOMETRY, request.source_config())]
    return [f"{prefix}{name}" for prefix, config in named for name in _names(config)]


def seed_matters(request: Request, association: str) -> bool:
    """Whether the algorithm draws random numbers: two seeds, one step, two answers."""
    step, dt_s = np.array([[1.0, 0.0, 0.1]]), np.array([1.0])
    one, other = (
        replace(request, seed=seed).made(association).predict(step, dt_s)[0] for seed in (0, 1)
    )
    return not np.array_equal(one, other)


def _places(
    space: Space, request: Request, runs: int | None, seed: int
) -> Iterator[Iterator[ParameterSet]]:
    """For each place of the search its candidates, of which the first possible one is taken."""
    if not space:
        return
    if runs is None:
        yield from (iter([candidate]) for candidate in grid(space))
        return
    whole = {key: isinstance(_value_at(request, key), int) for key in space}
    for number in range(runs):
        yield islice(draws(space, whole, seed, number), TRIES)


def _trial(number: int, parameters: ParameterSet, request: Request) -> Trial | None:
    """None where the values, each of them good, contradict each other."""
    asked = _with(request, parameters)
    try:
        asked.config(), asked.cone_config(), asked.source_config()
    except UsageError:
        return None
    return Trial(number, parameters, asked)


def _with(request: Request, parameters: ParameterSet) -> Request:
    words = tuple(f"{key}={text}" for key, text in sorted(parameters.items()))
    return replace(request, settings=(*request.settings, *words))


def _known(space: Space, request: Request) -> set[str]:
    return set(space) & set(parameter_names(request))


def _unknown(space: Space, requests: Sequence[Request], known: Mapping[str, set[str]]) -> list[str]:
    names = {name for request in requests for name in parameter_names(request)}
    unknown = [key for key in space if not any(key in own for own in known.values())]
    return [f"{key}: no such parameter; {_hint(key, names)}" for key in unknown]


def _hint(key: str, names: Collection[str]) -> str:
    """The names that end so, or else the nearest."""
    ending = sorted(name for name in names if name.endswith(f".{key}"))
    return f"did you mean {' or '.join(ending)}?" if ending else nearest_names(key, names)


def _value_faults(space: Space, request: Request, known: Mapping[str, set[str]]) -> list[str]:
    """A line for each value that its parameter cannot have, whatever the others are."""
    faults = []
    for key in space:
        if key not in known[request.algorithm]:
            continue
        ends = space[key]
        if isinstance(ends, Range) and isinstance(_value_at(request, key), str | bool):
            faults.append(f"{key}: is no number, a range of it cannot be; give a list")
            continue
        for text in ends.texts:
            try:
                _checked_alone(request, key, text)
            except UsageError as err:
                faults.append(str(err))
    return faults


def _checked_alone(request: Request, key: str, text: str) -> None:
    """Raise `UsageError` where a value is wrong in itself."""
    from capture import with_overrides

    prefix = next((p for p in (CONES, ODOMETRY) if key.startswith(p)), "")
    with_overrides(_part(request, prefix), [f"{key.removeprefix(prefix)}={text}"])


def _part(request: Request, prefix: str) -> Any:
    if prefix == CONES:
        return request.cone_config()
    return request.source_config() if prefix == ODOMETRY else request.config()


def _value_at(request: Request, key: str) -> object:
    prefix = next((p for p in (CONES, ODOMETRY) if key.startswith(p)), "")
    value = _part(request, prefix)
    for name in key.removeprefix(prefix).split("."):
        value = getattr(value, name)
    return value


def _names(config: Any) -> Iterator[str]:
    for part in dataclasses.fields(config):
        value = getattr(config, part.name)
        if dataclasses.is_dataclass(value):
            yield from (f"{part.name}.{name}" for name in _names(value))
        else:
            yield part.name
