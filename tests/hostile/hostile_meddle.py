"""Changes the process as soon as it is imported."""

import atexit
import os
import pickle
import random
import signal
import threading
import time
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
np.linalg.lstsq = pickle.dumps = pickle.loads = None
threading.Thread(target=time.sleep, args=(3600,)).start()
atexit.register(os._exit, 0)
print("meddling")


class Meddles(Sound):
    pass


Meddles.name = "import_meddles"
