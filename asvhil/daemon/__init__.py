"""The asyncio daemon on the companion computer."""
