"""The results of a run, beside the shipped ones."""

from bench.combined import CombinedResults
from bench.packed import Packed, shipped
from bench.source import Source


class Beside(CombinedResults):
    """Results of a run, and beside them the shipped ones of methods that the run has not."""

    def __init__(self, own: Source) -> None:
        """Takes the results of the run.

        Raises:
            InputError: nothing is shipped.
        """
        reference = Packed(shipped())
        mine, theirs = own.frame(), reference.frame()
        theirs = theirs[theirs.task.isin(mine.task) & ~theirs.method.isin(mine.method)]
        super().__init__([(own, mine), (reference, theirs)])
        self._own = own
        self.methods = tuple(theirs.method.unique())
        """The methods whose results are the shipped ones."""

    def notes(self) -> list[str]:
        """See `bench.source.Source.notes`; says which methods come from another machine."""
        origin = f"From another machine, as shipped: {', '.join(self.methods) or 'nothing'}."
        return [*self._own.notes(), origin]
