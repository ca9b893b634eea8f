"""Learning on station: a small correction of the vessel model, while a station is held."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from asvhil.config.base import NonNegative, Positive, Section

Factor = Annotated[float, Field(ge=0.2, le=3.0)]


class LearningConfig(Section):
    """Learning on station: factors of the motors' thrust and of the response in each axis (docs/learning.md)."""

    enabled: bool = Field(default=False, description="Whether the model is corrected while a station is held.")
    adapt: bool = Field(default=True, description="False: the factors stay at `start`, and nothing is learned.")
    start: tuple[Factor, Factor, Factor, Factor, Factor] = Field(
        default=(1.0, 1.0, 1.0, 1.0, 1.0),
        description="Factors to begin with: thrust of the port and the starboard motor, response in surge, sway, yaw.",
    )
    responses: bool = Field(
        default=False,
        description="Whether the responses correct the model too; false: they are learned and told alone.",
    )
    file: str | None = Field(
        default=None,
        description="Where a run leaves what it has learned; null: `learned-VEHICLE.json` in recorder.directory.",
    )
    least: Factor = Field(default=0.5, description="Lower bound of each factor.")
    most: Factor = Field(default=1.5, description="Upper bound of each factor.")
    prior_std: Positive = Field(
        default=0.2, le=1.0, description="Standard deviation of a factor that nothing is known of."
    )
    walk: NonNegative = Field(
        default=0.004,
        le=0.1,
        description="Random walk of each factor (per sqrt(s)): how fast evidence is forgotten.",
    )
    disturbance_walk_mps2: Positive = Field(
        default=0.006, le=0.1, description="Random walk of the disturbance beside the factors (m/s^2 per sqrt(s))."
    )
    disturbance_yaw_walk_radps2: Positive = Field(
        default=0.003,
        le=0.1,
        description="Random walk of the disturbance in yaw beside the factors.",
    )

    @model_validator(mode="after")
    def _check_bounds(self) -> LearningConfig:
        if not self.least < self.most:
            raise ValueError("least < most must hold")
        if not all(self.least <= factor <= self.most for factor in self.start):
            raise ValueError(f"each of start must lie within least and most, {self.least:g} to {self.most:g}")
        return self
