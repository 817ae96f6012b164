"""What runs once per command period: sensor chain, filters, compliance, ALTER, servo, guard."""
