"""Physical models as pure functions over floats: devices, hands, contacts, sensors."""
