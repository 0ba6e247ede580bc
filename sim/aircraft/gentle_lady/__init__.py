"""The aeroplane "gentle_lady": a two-metre polyhedral sailplane flown by rudder and elevator."""
