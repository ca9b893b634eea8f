"""The earth's magnetic field at a place: the World Magnetic Model 2025, close to that of an autopilot."""

from __future__ import annotations

import math

REFERENCE_RADIUS_M = 6_371_200.0
WGS84_A_M, WGS84_B_M = 6_378_137.0, 6_356_752.314245
EPOCH_YEAR = 2025.0
NT_PER_GAUSS = 1e5
DEGREE = 12

# WMM2025 (NOAA NCEI and British Geological Survey, public domain): n, m, g, h (nT), and their change (nT a year).
_TABLE = """
1 0 -29351.8 0.0 12.0 0.0
1 1 -1410.8 4545.4 9.7 -21.5
2 0 -2556.6 0.0 -11.6 0.0
2 1 2951.1 -3133.6 -5.2 -27.7
2 2 1649.3 -815.1 -8.0 -12.1
3 0 1361.0 0.0 -1.3 0.0
3 1 -2404.1 -56.6 -4.2 4.0
3 2 1243.8 237.5 0.4 -0.3
3 3 453.6 -549.5 -15.6 -4.1
4 0 895.0 0.0 -1.6 0.0
4 1 799.5 278.6 -2.4 -1.1
4 2 55.7 -133.9 -6.0 4.1
4 3 -281.1 212.0 5.6 1.6
4 4 12.1 -375.6 -7.0 -4.4
5 0 -233.2 0.0 0.6 0.0
5 1 368.9 45.4 1.4 -0.5
5 2 187.2 220.2 0.0 2.2
5 3 -138.7 -122.9 0.6 0.4
5 4 -142.0 43.0 2.2 1.7
5 5 20.9 106.1 0.9 1.9
6 0 64.4 0.0 -0.2 0.0
6 1 63.8 -18.4 -0.4 0.3
6 2 76.9 16.8 0.9 -1.6
6 3 -115.7 48.8 1.2 -0.4
6 4 -40.9 -59.8 -0.9 0.9
6 5 14.9 10.9 0.3 0.7
6 6 -60.7 72.7 0.9 0.9
7 0 79.5 0.0 0.0 0.0
7 1 -77.0 -48.9 -0.1 0.6
7 2 -8.8 -14.4 -0.1 0.5
7 3 59.3 -1.0 0.5 -0.8
7 4 15.8 23.4 -0.1 0.0
7 5 2.5 -7.4 -0.8 -1.0
7 6 -11.1 -25.1 -0.8 0.6
7 7 14.2 -2.3 0.8 -0.2
8 0 23.2 0.0 -0.1 0.0
8 1 10.8 7.1 0.2 -0.2
8 2 -17.5 -12.6 0.0 0.5
8 3 2.0 11.4 0.5 -0.4
8 4 -21.7 -9.7 -0.1 0.4
8 5 16.9 12.7 0.3 -0.5
8 6 15.0 0.7 0.2 -0.6
8 7 -16.8 -5.2 0.0 0.3
8 8 0.9 3.9 0.2 0.2
9 0 4.6 0.0 0.0 0.0
9 1 7.8 -24.8 -0.1 -0.3
9 2 3.0 12.2 0.1 0.3
9 3 -0.2 8.3 0.3 -0.3
9 4 -2.5 -3.3 -0.3 0.3
9 5 -13.1 -5.2 0.0 0.2
9 6 2.4 7.2 0.3 -0.1
9 7 8.6 -0.6 -0.1 -0.2
9 8 -8.7 0.8 0.1 0.4
9 9 -12.9 10.0 -0.1 0.1
10 0 -1.3 0.0 0.1 0.0
10 1 -6.4 3.3 0.0 0.0
10 2 0.2 0.0 0.1 0.0
10 3 2.0 2.4 0.1 -0.2
10 4 -1.0 5.3 0.0 0.1
10 5 -0.6 -9.1 -0.3 -0.1
10 6 -0.9 0.4 0.0 0.1
10 7 1.5 -4.2 -0.1 0.0
10 8 0.9 -3.8 -0.1 -0.1
10 9 -2.7 0.9 0.0 0.2
10 10 -3.9 -9.1 0.0 0.0
11 0 2.9 0.0 0.0 0.0
11 1 -1.5 0.0 0.0 0.0
11 2 -2.5 2.9 0.0 0.1
11 3 2.4 -0.6 0.0 0.0
11 4 -0.6 0.2 0.0 0.1
11 5 -0.1 0.5 -0.1 0.0
11 6 -0.6 -0.3 0.0 0.0
11 7 -0.1 -1.2 0.0 0.1
11 8 1.1 -1.7 -0.1 0.0
11 9 -1.0 -2.9 -0.1 0.0
11 10 -0.2 -1.8 -0.1 0.0
11 11 2.6 -2.3 -0.1 0.0
12 0 -2.0 0.0 0.0 0.0
12 1 -0.2 -1.3 0.0 0.0
12 2 0.3 0.7 0.0 0.0
12 3 1.2 1.0 0.0 -0.1
12 4 -1.3 -1.4 0.0 0.1
12 5 0.6 0.0 0.0 0.0
12 6 0.6 0.6 0.1 0.0
12 7 0.5 -0.1 0.0 0.0
12 8 -0.1 0.8 0.0 0.0
12 9 -0.4 0.1 0.0 0.0
12 10 -0.2 -1.0 -0.1 0.0
12 11 -1.3 0.1 0.0 0.0
12 12 -0.7 0.2 -0.1 -0.1
"""


def _rows(table: str) -> tuple[tuple[int, int, float, float, float, float], ...]:
    fields = (line.split() for line in table.strip().splitlines())
    return tuple((int(n), int(m), float(g), float(h), float(dg), float(dh)) for n, m, g, h, dg, dh in fields)


_COEFFICIENTS = _rows(_TABLE)


def earth_field_gauss(lat_deg: float, lon_deg: float, year: float) -> tuple[float, float, float]:
    """North, east and down component (gauss) at sea level, for a year such as 2026.5.

    Minus the gradient of the potential sum (a / r)^(n + 1) (g cos m lon + h sin m lon) P_nm(sin lat'), with Schmidt's
    semi-normalised functions of the geocentric latitude lat' (the model's technical report, eq. 4 to 17).
    """
    lat, lon = math.radians(max(-89.99, min(89.99, lat_deg))), math.radians(lon_deg)
    # Geocentric latitude and radius of the point on the ellipsoid.
    x, z = WGS84_A_M**2 * math.cos(lat), WGS84_B_M**2 * math.sin(lat)
    scale = 1.0 / math.hypot(WGS84_A_M * math.cos(lat), WGS84_B_M * math.sin(lat))
    geocentric, radius_m = math.atan2(z, x), math.hypot(x, z) * scale
    p, dp = _schmidt(geocentric)
    north = east = down = 0.0
    for n, m, g, h, g_rate, h_rate in _COEFFICIENTS:
        falloff = (REFERENCE_RADIUS_M / radius_m) ** (n + 2)
        g_now, h_now = g + (year - EPOCH_YEAR) * g_rate, h + (year - EPOCH_YEAR) * h_rate
        c, s = math.cos(m * lon), math.sin(m * lon)
        north -= falloff * (g_now * c + h_now * s) * dp[n][m]
        east += falloff * m * (g_now * s - h_now * c) * p[n][m] / math.cos(geocentric)
        down -= falloff * (n + 1) * (g_now * c + h_now * s) * p[n][m]
    tilt = geocentric - lat  # from the geocentric to the geodetic vertical
    c, s = math.cos(tilt), math.sin(tilt)
    return (
        (north * c - down * s) / NT_PER_GAUSS,
        east / NT_PER_GAUSS,
        (north * s + down * c) / NT_PER_GAUSS,
    )


def _schmidt(latitude: float) -> tuple[list[list[float]], list[list[float]]]:
    """P[n][m] of sin(latitude) and its derivative by the latitude, by the recursions in n."""
    s, c = math.sin(latitude), math.cos(latitude)
    p = [[0.0] * (DEGREE + 1) for _ in range(DEGREE + 1)]
    dp = [[0.0] * (DEGREE + 1) for _ in range(DEGREE + 1)]
    p[0][0] = 1.0
    for n in range(1, DEGREE + 1):
        k = 1.0 if n == 1 else math.sqrt((2 * n - 1) / (2 * n))
        p[n][n] = k * c * p[n - 1][n - 1]
        dp[n][n] = k * (c * dp[n - 1][n - 1] - s * p[n - 1][n - 1])
        for m in range(n):
            root = math.sqrt(n * n - m * m)
            before = math.sqrt((n - 1) ** 2 - m * m) / root if m < n - 1 else 0.0
            last = (2 * n - 1) / root
            older, d_older = (p[n - 2][m], dp[n - 2][m]) if m < n - 1 else (0.0, 0.0)
            p[n][m] = last * s * p[n - 1][m] - before * older
            dp[n][m] = last * (s * dp[n - 1][m] + c * p[n - 1][m]) - before * d_older
    return p, dp
