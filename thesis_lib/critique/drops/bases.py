"""Models without effects that the critique starts from: the impact laws, and a compliant contact.

`COMPLIANT` is a linear spring that returns the share ε² of its work, with Coulomb friction; it takes time.

    loading    f_n = k δ
    unloading  f_n = k δ_m (δ − δ_0)₊ / (δ_m − δ_0),   δ_0 = (1 − ε²) δ_m,   δ_m the greatest depth so far

The shorter the contact, the less does the body move meanwhile.  In the limit the impulse is that of Routh's path with
Stronge's energetic restitution, which is Mirtich's law; `impulse` is this limit.  Where contacts take time, the
critique integrates the motion of the body under the force (`thesis_lib/critique/drops/pressing.py`).

Source: Walton and Braun 1986, doi:10.1122/1.549893.
"""

from collections import ChainMap
from collections.abc import Mapping
from dataclasses import replace

from thesis_lib.contact import LAWS, mirtich
from thesis_lib.contact.law import Law

COMPLIANT = replace(
    mirtich.LAW,
    name="compliant_contact",
    title="compliant contact",
    reference="Walton and Braun 1986, doi:10.1122/1.549893",
    is_compliant=True,
)
BASES: Mapping[str, Law] = ChainMap({COMPLIANT.name: COMPLIANT}, LAWS)
RESERVE = (COMPLIANT.name,)  # those that are tried where rigid laws leave an error
