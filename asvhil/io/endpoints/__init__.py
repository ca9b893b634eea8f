"""The kinds of link behind `asvhil.io.endpoint`; nobody else imports them."""
