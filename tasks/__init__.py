"""Four Adroit-hand tasks in MuJoCo. This package knows nothing about methods."""
