"""Hard cases of machines: kills, full disks, folders that go away; no finished work is lost."""
