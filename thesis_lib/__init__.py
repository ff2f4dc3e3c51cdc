"""Contact models in robotic manipulation: reproduce, criticise, augment, learn the rest.

If imported before NumPy, the package selects the numerical kernels of `foundation.kernels`: the library then gives the
same last digits as the command line.
"""

from thesis_lib.foundation.kernels import use_common_kernels

__version__ = "1.0.0"

use_common_kernels()
