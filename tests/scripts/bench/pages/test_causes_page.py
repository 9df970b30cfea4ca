"""The page of Sobol's indices names the causes that are told apart, strongest first, and no other."""

from haustra.scripts.bench.pages.causes_page import causes_page


def _index(score: str, variable: str, total: float, confidence: float) -> dict:
    return {
        "score": score,
        "variable": variable,
        "first": 0.1,
        "first_confidence": 0.05,
        "total": total,
        "total_confidence": confidence,
    }


def test_causes_are_listed_strongest_first_where_they_are_told_apart() -> None:
    indices = [
        _index("caecum", "friction", 0.4, 0.1),
        _index("caecum", "bending", 0.7, 0.2),
        _index("caecum", "pleating", 0.2, 0.3),
        _index("half_metre", "modulus", 0.0, 0.1),
    ]
    page = causes_page({"confidence": 0.95, "points_left_out": 0.0, "indices": indices})
    rows = [line for line in page.splitlines() if "(±" in line]
    assert [row.split(" | ")[1] for row in rows] == ["bending", "friction"]
    assert "0.70 (± 0.20)" in rows[0] and "64 points: 384 examinations" in page and "Every examination" in page
    assert "the 4 numbers" in page  # those that were varied, whatever the study varies now
    left = causes_page({"confidence": 0.95, "points_left_out": 0.25, "indices": indices})
    assert "25% of the points are left out" in left
