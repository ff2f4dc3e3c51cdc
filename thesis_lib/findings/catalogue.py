"""All findings by the name of their figure or table."""

from thesis_lib.findings import chapter2, chapter3, chapter4, chapter5, claims, critique
from thesis_lib.findings.finding import Finding

FINDINGS: dict[str, Finding] = {
    **chapter2.FINDINGS,
    **chapter3.FINDINGS,
    **chapter4.FINDINGS,
    **chapter5.FINDINGS,
    **critique.FINDINGS,
    **claims.FINDINGS,
}
