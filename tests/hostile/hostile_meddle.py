"""Changes the process as soon as it is imported."""

import os
import random
import signal
import warnings

import numpy as np
import torch
from hostile import Sound

torch.set_default_dtype(torch.float64)
torch.set_num_threads(2)
np.seterr(all="raise")
np.random.seed(0)
random.seed(0)
warnings.simplefilter("error")
signal.signal(signal.SIGTERM, signal.SIG_IGN)
os.environ["OMP_NUM_THREADS"] = "2"
os.chdir("/")
np.linalg.lstsq = None


class Meddles(Sound):
    pass


Meddles.name = "import_meddles"
