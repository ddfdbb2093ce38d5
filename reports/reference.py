"""The results of a run, with the shipped results of the methods that it lacks."""

from bench.combined import CombinedResults
from bench.packed import Packed, shipped
from bench.source import Source


class WithShippedMethods(CombinedResults):
    """The results of a run, and the shipped results of methods that it lacks."""

    def __init__(self, own: Source) -> None:
        """Joins the results of the run with the shipped ones.

        Raises:
            InputError: no results are shipped.
        """
        reference = Packed(shipped())
        mine, theirs = own.frame(), reference.frame()
        trained = mine[mine.weights == ""].method
        alike = theirs.task.isin(mine.task) & theirs.expert.isin(mine.expert)
        theirs = theirs[alike & ~theirs.method.isin(trained)]
        super().__init__([(own, mine), (reference, theirs)])
        self._own = own
        self._marks = set(theirs.pins) - set(mine.pins)
        self.methods = tuple(theirs.method.unique())
        """The methods with shipped results."""

    def notes(self) -> list[str]:
        """See `bench.source.Source.notes`. A further note names the shipped methods."""
        marks = "".join(f", with kernels marked {one}" for one in sorted(self._marks))
        origin = f"From another machine{marks}, as shipped: {', '.join(self.methods) or 'nothing'}."
        return [*self._own.notes(), origin]
