"""The costs of commands on this machine, now: calibration table, speed and free cores."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path

from diff4splat.errors import ConfigError
from diff4splat.outputs.budgets.choose import Choice, broken, choose
from diff4splat.outputs.budgets.costs import (
    WORTH_SAYING_S,
    Forecast,
    Work,
    duration,
    forecast,
    free_cores,
    gigabytes,
    unknown_work,
)
from diff4splat.outputs.budgets.limits import Limits
from diff4splat.outputs.budgets.speed import (
    is_comparable,
    machine_name,
    measure_speed_s,
    require_comparable,
)
from diff4splat.outputs.budgets.table import (
    RENEW,
    CalibrationTable,
    SettingRow,
    SettingValues,
    find_table,
)


@dataclass(frozen=True)
class Costing:
    """Forecasts from one table; the speed is measured when it is first needed."""

    table: CalibrationTable

    @classmethod
    def of(cls, calibration: Path | None = None) -> "Costing":
        """From a file, or the table that fits this machine best.

        Raises:
            Diff4SplatError: the table cannot be used.
        """
        return cls(find_table(calibration))

    @cached_property
    def speed(self) -> float:
        """How many times as slow this machine is as that of the table."""
        return measure_speed_s() / self.table.speed_s

    @cached_property
    def cores(self) -> float:
        """Cores that are free at the moment."""
        return free_cores()

    def knows(self, command: str, work: Work) -> bool:
        """Whether the table has costs of all of ``work``."""
        return command in self.table.rates and not unknown_work(self.table.rates[command], work)

    def require_known(self, command: str, work: Work) -> None:
        """Refuse work whose costs nobody has measured.

        Raises:
            ConfigError: the table does not know the command, or a part of its work, or is that of
                a machine too different from this one.
        """
        require_comparable(self.speed, self.table.machine)
        if unknown := unknown_work(self.table.of(command)[0], work):
            known = ", ".join(sorted(self.table.rates[command].seconds))
            raise ConfigError(
                f"forecast: expected work that was measured ({known}), got {unknown[0]}; {RENEW}"
            )

    def forecast(self, command: str, work: Work) -> Forecast:
        """What ``work`` costs.

        Raises:
            ConfigError: the table does not know the command.
        """
        return forecast(self.table.of(command)[0], work, self.speed, self.cores)

    def choose(
        self,
        command: str,
        work: Callable[[SettingValues], Work],
        allowed: Callable[[SettingValues], bool],
        limits: Limits,
        error: Callable[[SettingRow], float] = lambda row: row.error,
    ) -> Choice:
        """The setting of ``command`` among the ``allowed`` ones that the limits ask for.

        ``error`` is what a row of the table means here, where it is a share of something.

        Raises:
            ConfigError: none holds; says what is possible. Or the table's machine is too different.
        """
        require_comparable(self.speed, self.table.machine)
        _, rows = self.table.of(command)
        options = [
            Choice(
                values=row.values,
                expected=self.forecast(command, work(row.values)),
                error=error(row),
            )
            for row in rows
            if allowed(row.values)
        ]
        return choose(options, limits)

    def plain_promise(self, command: str, work: Work) -> "Promise | None":
        """The same without limits; None for work that was not measured: nothing is said of it."""
        return self.promise(command, Limits(), work) if self.knows(command, work) else None

    def promise(self, command: str, limits: Limits, work: Work) -> "Promise":
        """What ``work`` is expected to need, before any setting is chosen."""
        return Promise(
            limits=limits,
            expected=self.forecast(command, work),
            speed=self.speed,
            cores=self.cores,
            machine="" if self.table.machine == machine_name() else self.table.machine,
        )


@dataclass(frozen=True, kw_only=True)
class Promise:
    """What a run was expected to need and to lose, and under which limits."""

    limits: Limits
    expected: Forecast
    choice: Choice | None = None
    speed: float = 1.0
    cores: float = 1.0
    machine: str = ""
    """Of the calibration, where it is another one."""

    def lines(self) -> list[str]:
        """What to say before the work: the choice, or a forecast of what takes long."""
        if self.choice is not None:
            scaled = f"measured on {self.machine}, times scaled by {self.speed:.2g}"
            other = [f"calibration {scaled}"] if self.machine else []
            return [f"within {self.limits}: {self.choice}", *other]
        if self.expected.seconds < WORTH_SAYING_S or not is_comparable(self.speed):
            return []
        return [f"forecast: {self.expected}"]

    def record(self, measured: dict[str, float | int]) -> dict[str, object]:
        """For the card: what was expected and what was measured."""
        record: dict[str, object] = {
            "limits": {name: value for name, value in asdict(self.limits).items() if value},
            "expected": asdict(self.expected),
            "measured": measured,
            "machine_speed": round(self.speed, 3),
            "free_cores": round(self.cores, 3),
        }
        if self.choice is not None:
            record["setting"] = dict(self.choice.values)
            record["expected"] |= {"loss_db": self.choice.loss_db}
        record["not_held"] = broken(self.limits, measured)
        return record

    def after(self, measured: dict[str, float | int]) -> list[str]:
        """What to say after the work of a command without a card: the comparison."""
        if not self.limits.given and self.expected.seconds < WORTH_SAYING_S:
            return []
        loss = f", {measured['loss_db']:.2g} dB lost" if "loss_db" in measured else ""
        line = (
            f"measured: {duration(measured['seconds'])} "
            f"({duration(measured['cpu_seconds'])} of processor time), "
            f"{gigabytes(measured['memory_bytes'])}{loss}"
        )
        return [line, *filter(None, [broken(self.limits, measured)])]

    def with_choice(self, choice: Choice) -> "Promise":
        """The same with a setting that was chosen."""
        return replace(self, choice=choice, expected=choice.expected)
