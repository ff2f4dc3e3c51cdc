"""Contact models in robotic manipulation: reproduce, criticise, augment, learn the rest.

Imported before NumPy, the package asks for the kernels of `foundation.kernels`, so that the library gives the same last
digits as the command line.
"""

from thesis_lib.foundation.kernels import use_common_kernels

__version__ = "1.0.0"

use_common_kernels()
