"""The base of methods whose networks learn by `methods.training`: it keeps what they learnt."""

from collections.abc import Sequence
from typing import Any, Self

from methods.base import Method, NotFittedError, Parameters
from methods.layers import Weights, tensor
from methods.training import Trained
from tasks.data import Demos, Layout


class TrainedMethod(Method):
    """A method with a network. It implements `fit_seeds`, which gives each seed its `_learnt`."""

    validates = True

    def __init__(self, config: Any, layout: Layout) -> None:
        super().__init__(config, layout)
        self._arrays: Parameters | None = None
        self._trained: Trained | None = None

    def fit(self, demos: Demos, validation: Demos, seed: int) -> None:
        """Trains one network."""
        (fitted,) = self.fit_seeds(self.config, self.layout, [demos], [validation], [seed])
        self._arrays, self._trained = fitted._arrays, fitted._trained

    @classmethod
    def _fitted(
        cls, config: Any, layout: Layout, trained: Sequence[Trained], scales: Sequence[Parameters]
    ) -> list[Self]:
        """Returns a method for each network, with the scaling that it was trained with."""
        methods = [cls(config, layout) for _ in trained]
        for method, result, scale in zip(methods, trained, scales, strict=True):
            method._arrays, method._trained = result.weights | scale, result
        return methods

    def parameters(self) -> Parameters:
        """Returns the weights, and the scaling of what the network reads and answers."""
        if self._arrays is None:
            raise NotFittedError(f"this {self.name} has no weights yet: call fit or load")
        return self._arrays

    def load(self, parameters: Parameters) -> None:
        """Restores the weights and the scaling."""
        self._arrays, self._trained = dict(parameters), None

    def diagnostics(self) -> Parameters:
        """Returns, after a fit, the ``losses`` and ``validation_losses`` of each epoch."""
        if self._trained is None:
            return {}
        return {"losses": self._trained.losses, "validation_losses": self._trained.validation}

    def weights(self, scales: tuple[str, ...]) -> Weights:
        """Returns the weights as one network's, (1, ...).

        Args:
            scales: how the names of arrays begin that are scaling and no weights.
        """
        arrays = self.parameters().items()
        return {name: tensor(array)[None] for name, array in arrays if not name.startswith(scales)}
