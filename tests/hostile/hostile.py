"""Methods with a vice each, as strangers' packages may have them."""

import os
import pickle
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
import warnings
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
import torch

from methods.base import ActionMethod, MotionMethod, NotFittedError
from methods.nn import NN


@dataclass(frozen=True)
class Config:
    scale: float = 1.0


class Sound(MotionMethod):
    """Replays the demonstration that began nearest."""

    summary = "nearest demonstration"
    sizes = {"single": Config()}
    default_size = {}
    states = None

    def __init_subclass__(cls):
        cls.name = cls.__name__.lower()

    def vice(self, demos):
        """The misbehaviour of the method, which happens in each fit."""

    def fit(self, demos, validation, seed):
        self.states = demos.states.copy()
        self.vice(demos)

    def parameters(self):
        if self.states is None:
            raise NotFittedError("call fit first")
        return {"states": self.states}

    def load(self, parameters):
        self.states = parameters["states"]

    def rollout(self, start, steps):
        if self.states is None:
            raise NotFittedError("call fit first")
        states = self.states
        apart = np.linalg.norm(start[:, None] - states[:, 0], axis=-1)
        motion = states[apart.argmin(axis=1), : steps + 1].copy()
        motion[:, 0] = start
        return motion


class Exits(Sound):
    def vice(self, demos):
        sys.exit(4)


class Leaves(Sound):
    def vice(self, demos):
        os._exit(0)


class Aborts(Sound):
    def rollout(self, start, steps):
        os.abort()


class Kills(Sound):
    def vice(self, demos):
        os.kill(os.getpid(), signal.SIGKILL)


class Interrupts(Sound):
    def vice(self, demos):
        raise KeyboardInterrupt


class Alarms(Sound):
    def vice(self, demos):
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(1)
        time.sleep(30)


class Hangs(Sound):
    def vice(self, demos):
        while True:
            try:
                time.sleep(60)
            except BaseException:
                continue


class Asks(Sound):
    def vice(self, demos):
        input("Which learning rate? ")


class Hides(Sound):
    def vice(self, demos):
        class SecretError(Exception):
            def __str__(self):
                raise RuntimeError("no message")

        raise SecretError


class Recurses(Sound):
    def vice(self, demos):
        self.vice(demos)


class Writes(Sound):
    def vice(self, demos):
        demos.states[:] = 0


class Shapes(Sound):
    def rollout(self, start, steps):
        return super().rollout(start, steps)[:, 1:]


class Lists(Sound):
    def rollout(self, start, steps):
        return super().rollout(start, steps).tolist()


class Masks(Sound):
    def rollout(self, start, steps):
        return np.ma.masked_less(super().rollout(start, steps), 0)


class Empties(Sound):
    def parameters(self):
        return {}


class Objects(Sound):
    def parameters(self):
        return {"states": np.array([self.states, None], dtype=object)}


class Longs(Sound):
    def parameters(self):
        return {"states": self.states.astype(np.longdouble)}


class Metadata(Sound):
    def parameters(self):
        return {"__metadata__": self.states}


class Swells(Sound):
    def parameters(self):
        return {"states": np.zeros((2**30, 2), np.float16)}


class Slashes(Sound):
    sizes = {"w/o": Config()}


@dataclass(frozen=True)
class Function:
    scale: object = len


class Lambdas(Sound):
    sizes = {"single": Function()}


@dataclass(frozen=True)
class Auto:
    epochs: str = "auto"


class Autos(Sound):
    sizes = {"single": Auto()}


@dataclass(frozen=True)
class Wider(Config):
    width: int = 512


class Kinds(Sound):
    sizes = {"small": Config(), "large": Wider()}


class Kind(StrEnum):
    GOOD = "good"


@dataclass(frozen=True)
class OfAKind:
    kind: Kind = Kind.GOOD


class Enums(Sound):
    sizes = {"single": OfAKind()}


class Both(Sound, ActionMethod):
    def reset(self, starts, rngs):
        pass

    def act(self, state, t):
        return np.zeros((len(state), self.layout.action_dim))


class Tells(Sound):
    def vice(self, demos):
        print("there is no licence file")
        raise RuntimeError("see above")


class Floods(Sound):
    def vice(self, demos):
        os.ftruncate(1, 2**43)
        os.abort()


class Signals(Sound):
    def vice(self, demos):
        os.kill(os.getpid(), 40)


class Reserved(Sound):
    def __init_subclass__(cls):
        pass


Reserved.name = "expert"


# From here on, what they do harms others and not themselves.
class Moves(Sound):
    def vice(self, demos):
        os.chdir("/")


class Doubles(Sound):
    def vice(self, demos):
        torch.set_default_dtype(torch.float64)
        torch.set_num_threads(2)
        np.seterr(all="raise")


class Seeds(Sound):
    def vice(self, demos):
        random.seed(1)
        np.random.seed(1)
        torch.manual_seed(1)


class Draws(Sound):
    def vice(self, demos):
        noise = np.random.randn(*self.states.shape) + random.random() + torch.rand(1).item()
        self.states += 1e-3 * noise


class Solves(Sound):
    def vice(self, demos):
        x = demos.states[:, :-1].reshape(-1, demos.states.shape[-1])
        gram = x.T @ x + np.eye(x.shape[1])
        self.states = self.states + 1e-9 * np.linalg.solve(gram, x.T @ x)[0]


class Forks(Sound):
    def vice(self, demos):
        os.fork()


class Orphans(Sound):
    def vice(self, demos):
        code = "import os; os.fork() or (os.setsid(), os.execlp('sleep', 'sleep', '3607'))"
        subprocess.run([sys.executable, "-c", code], start_new_session=True, check=True)


class Removes(Sound):
    def vice(self, demos):
        shutil.rmtree(os.getcwd())


class Patches(Sound):
    def vice(self, demos):
        np.linalg.lstsq = np.linalg.solve = np.einsum = pickle.dumps = None
        NN.rollout = NN.draw = None
        MotionMethod.diagnostics = lambda self: {"patched": np.ones(1)}


class Threads(Sound):
    def vice(self, demos):
        threading.Thread(target=time.sleep, args=(3600,)).start()


class Children(Sound):
    def vice(self, demos):
        subprocess.Popen(["sleep", "3600"])


class Prints(Sound):
    def vice(self, demos):
        for epoch in range(20_000):
            print("epoch", epoch)
        os.system("echo told by a child")


class Closes(Sound):
    def vice(self, demos):
        sys.stdout.close()
        sys.stdout = sys.stderr = None
        os.close(1)
        os.close(2)


class Warns(Sound):
    def vice(self, demos):
        warnings.simplefilter("error")
        os.environ.update(OMP_NUM_THREADS="2", BENCH_CACHE="/nowhere", HOME="/nowhere")


class Saves(Sound):
    def vice(self, demos):
        np.savez("best.npz", states=self.states)
        with np.load("best.npz") as best:
            self.states = best["states"]


class InPlace(Sound):
    def load(self, parameters):
        self.states = parameters["states"]
        self.states += 0.0


class Three(Sound):
    def vice(self, demos):
        if len(demos) < 3:
            raise ValueError("three demonstrations are needed")


class Complexes(Sound):
    def parameters(self):
        return {"states": super().parameters()["states"] * (1 + 0j)}

    def load(self, parameters):
        assert parameters["states"].dtype == complex
        self.states = parameters["states"].real.copy()

    def diagnostics(self):
        return {"eigenvalues": np.linalg.eigvals(np.array([[0.0, 1.0], [-1.0, 0.0]]))}


class Nans(Sound):
    def rollout(self, start, steps):
        motion = super().rollout(start, steps)
        motion[:, steps // 2 :] = np.nan
        return motion


@dataclass(frozen=True)
class Doubled:
    scale: float = 1.0
    double: float = field(init=False, default=0.0)

    def __post_init__(self):
        object.__setattr__(self, "double", 2 * self.scale)


class Derived(Sound):
    sizes = {"single": Doubled()}


class Loader(Sound):
    def vice(self, demos):
        data = torch.utils.data.TensorDataset(torch.from_numpy(demos.states))
        batches = torch.utils.data.DataLoader(data, batch_size=5, num_workers=2)
        self.states = torch.cat([batch for (batch,) in batches]).numpy()
