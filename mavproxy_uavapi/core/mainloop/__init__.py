"""Between MAVProxy's main loop, which alone sends, and one asyncio loop in a thread of its own."""
