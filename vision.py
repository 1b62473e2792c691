from mavproxy_vision.module import init as init
