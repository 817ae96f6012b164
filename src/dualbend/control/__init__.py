"""What runs every 28 ms: sensor chain, filters, admittance, ALTER, servo; no MuJoCo here."""
