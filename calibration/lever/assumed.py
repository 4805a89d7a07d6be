"""The lever arm with which a truth was made, as its provenance tells it."""

from __future__ import annotations

from collections.abc import Mapping

from capture import Session, configuration_from_mapping
from tracking import CarRings


def assumed_rings(session: Session) -> CarRings:
    """The rings on the car by the scene of `ground_truth.yaml`; the usual ones without a scene."""
    scene = session.ground_truth().provenance.get("scene")
    car = scene.get("car") if isinstance(scene, Mapping) else None
    if not isinstance(car, Mapping):
        return CarRings()
    return configuration_from_mapping(CarRings, car, f"{session.folder}/ground_truth.yaml")
