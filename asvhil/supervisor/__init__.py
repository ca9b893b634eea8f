"""Engagement, pilot watch and fail-safes: who has the motors."""
