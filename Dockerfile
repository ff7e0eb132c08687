# drake_rnn with films, compiled laws, drawings of the wiring, plans and drawings to follow:
#   docker build --tag drake-rnn .
#   docker run --rm -v "$PWD/out:/home/user/out" drake-rnn run slc_nephroid_warm_up
#   docker run --rm --network host drake-rnn live slc_nephroid_known    # it has two ports
# Debian's Python, 3.11, is the one that all tests run with.
FROM debian:bookworm-slim AS build
RUN apt-get update \
    && apt-get install -y --no-install-recommends ca-certificates python3-venv
COPY . /source
RUN python3 -m venv /venv \
    && /venv/bin/pip install --no-cache-dir build \
    && /venv/bin/python -m build --wheel --outdir /dist /source

FROM debian:bookworm-slim
# Of Drake: glib and EGL. Chromium is for films, gcc for compiled laws, Graphviz for wirings.
RUN apt-get update \
    && apt-get install -y --no-install-recommends \
       ca-certificates chromium chromium-driver gcc graphviz libc6-dev libegl1 libgl1-mesa-dri \
       libglib2.0-0 python3-venv \
    && rm -rf /var/lib/apt/lists/*
# It has no namespaces for users; Chromium shows pages of runs only.
RUN echo 'export CHROMIUM_FLAGS="$CHROMIUM_FLAGS --no-sandbox"' > /etc/chromium.d/container
COPY --from=build /dist /dist
COPY requirements.lock /dist/
RUN python3 -m venv /venv \
    && /venv/bin/pip install --no-cache-dir --constraint /dist/requirements.lock \
       "drake-rnn[film,jax,plan,svg,xacro] @ file://$(echo /dist/*.whl)"
ENV PATH=/venv/bin:$PATH
# Nothing here needs root.
RUN useradd --create-home user
USER user
WORKDIR /home/user
ENTRYPOINT ["drake-rnn"]
CMD ["--help"]
