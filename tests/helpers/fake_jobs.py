"""Jobs that compute nothing, for tests of the queue and the clock."""

from dataclasses import dataclass

from bench.costs import Cost


@dataclass(frozen=True)
class FakeJob:
    makes: tuple[str, ...]
    seconds: float = 1.0
    needs: tuple[str, ...] = ()
    after: tuple[str, ...] = ()
    kind: str = "fits"
    cost_kind: str = "fit"
    known: bool = True

    @property
    def label(self):
        return "+".join(self.makes)

    @property
    def cost(self):
        return Cost(self.cost_kind, self.seconds, self.known, len(self.makes))

    def parts(self):
        half = (len(self.makes) + 1) // 2
        share = self.seconds / len(self.makes)
        return [
            FakeJob(makes, share * len(makes), self.needs, self.after, self.kind, self.cost_kind)
            for makes in (self.makes[:half], self.makes[half:])
            if makes
        ]


def job(names, seconds=1.0, **fields):
    return FakeJob(tuple(names.split()), seconds, **fields)
