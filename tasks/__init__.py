"""What is to be done: four Adroit-hand tasks in MuJoCo, without any notion of a method."""

from tasks.pins import pin

pin()  # before NumPy and torch are loaded
