from mavproxy_gradys.module import init as init
